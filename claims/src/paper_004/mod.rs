//! Seed paper 004: IWO, greedy via points and cubics of least energy on a two-link arm.
pub(crate) mod energy;
pub(crate) mod via;
