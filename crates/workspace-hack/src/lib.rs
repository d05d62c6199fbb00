//! Nothing: its `Cargo.toml` names features of dependencies, and `bus` depends on it.
