//! The promises of every link, kept by SocketCAN on a real vcan, and what only the kernel's CAN can do.
//!
//! Runs in the vcan machine alone: `cargo test -p taustream-tests --test on_vcan --no-run`, then
//! `vcan-machine -- BINARY --test-threads=1`. Each test makes interfaces of its own.
use taustream_drivers as _;
