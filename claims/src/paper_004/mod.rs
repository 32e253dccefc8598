//! Sengupta et al. (2011): IWO, greedy via points and cubics of least energy on a two-link arm.
pub(crate) mod energy;
pub(crate) mod sweep;
pub(crate) mod via;
