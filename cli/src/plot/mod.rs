//! Pictures as SVG. Text stays text: no font file is needed to draw, the viewer's sans-serif is used.
//!
//! [`recording`] draws what a demo commanded and measured, [`motion`] a trajectory: its curves, and the arm in three
//! views among its obstacles; [`curves`] motions of one joint over each other.
pub(crate) mod curves;
pub(crate) mod motion;
mod outline;
mod panel;
pub(crate) mod recording;
mod views;
