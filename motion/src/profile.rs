//! The scalar profiles of the papers behind one trait.
