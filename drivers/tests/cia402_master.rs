//! The CiA 402 master against scripted drives and against frames written out by hand.
#![expect(clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
mod cia402_suite;

use cia402_suite::CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
