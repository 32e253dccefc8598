//! Lv et al. (2019): IEPSO, reward and punishment, on a position without inverse kinematics.
pub(crate) mod methods;
pub(crate) mod printed;
pub(crate) mod reward;
pub(crate) mod sweep;
mod watched;
