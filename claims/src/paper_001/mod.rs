//! Li, Xing and Qin (2025): ISMA on benchmark functions, and splines of degree seven.
pub(crate) mod benchmarks;
pub(crate) mod diagonal;
pub(crate) mod parts;
pub(crate) mod spline;
pub(crate) mod sweep;
