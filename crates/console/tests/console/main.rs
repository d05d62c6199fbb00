//! The real program, over real sockets.

mod client;
mod guards;
mod playback;
mod sockets;
mod token;
