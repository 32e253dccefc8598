//! Cases of the larger files.
use crate::common::Reader;

pub(crate) mod axes;
pub(crate) mod cubemars;
pub(crate) mod damiao;
pub(crate) mod feed_forward;
pub(crate) mod robstride;
pub(crate) mod settings;

/// Reader, text to replace, replacement, key of the fault, words that its sentence must have.
pub(crate) type Case = (Reader, &'static str, &'static str, &'static str, &'static str);
