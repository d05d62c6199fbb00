//! The console: the real program over real sockets, and on a real launch.

mod client;
mod guards;
mod load;
mod playback;
mod sockets;
mod token;
