//
// Copyright (c) 2026 the developers of CARS
//
// This program and the accompanying materials are made available under the
// terms of the Eclipse Public License 2.0 which is available at
// http://www.eclipse.org/legal/epl-2.0, or the Apache License, Version 2.0
// which is available at https://www.apache.org/licenses/LICENSE-2.0.
//
// SPDX-License-Identifier: EPL-2.0 OR Apache-2.0
//
//! Bounds the time until a session is open on a link. The transport does so, too, by dropping whatever it awaits when the time
//! is up, also when the session exists already and is about to be started. Such a session sends and never reads, and the peer
//! takes it for a living one. Here a link whose handshake takes too long fails to read, which the transport handles in order,
//! and a handshake that has read its last message is no longer bounded.

use std::{
    future::Future,
    sync::atomic::{AtomicU8, Ordering},
    time::Duration,
};

use tokio::time::Instant;
use zenoh_protocol::core::endpoint::Config;
use zenoh_result::{bail, zerror, ZResult};

/// Parameter of an endpoint: how long a handshake may take, milliseconds. Without it the link does not bound it.
pub const HANDSHAKE_MS: &str = "handshake_ms";

/// Reads in a handshake: each side receives two messages, each with its length before it.
const READS: u8 = 4;

/// The limit that an endpoint sets for handshakes.
pub fn handshake_limit(config: &Config<'_>) -> ZResult<Option<Duration>> {
    let Some(text) = config.get(HANDSHAKE_MS) else {
        return Ok(None);
    };
    let limit = text
        .parse()
        .map_err(|_| zerror!("{HANDSHAKE_MS} is not a number of milliseconds: {text}"))?;
    Ok(Some(Duration::from_millis(limit)))
}

/// The handshake of a link, which begins when the link is being made.
#[derive(Debug)]
pub struct Handshake {
    reads: AtomicU8,
    deadline: Option<Instant>,
}

impl Handshake {
    /// A handshake that begins now.
    pub fn begin(limit: Option<Duration>) -> Self {
        Self {
            reads: AtomicU8::new(0),
            deadline: limit.and_then(|limit| Instant::now().checked_add(limit)),
        }
    }

    /// Whether the last message has been read.
    fn is_over(&self) -> bool {
        self.reads.load(Ordering::Relaxed) >= READS
    }

    /// Does a step of the handshake. Fails when it is not done in time.
    pub async fn step<T>(&self, step: impl Future<Output = T>) -> ZResult<T> {
        let Some(deadline) = self.deadline else {
            return Ok(step.await);
        };
        let done = tokio::time::timeout_at(deadline, step).await;
        done.map_err(|_| zerror!("the handshake took too long").into())
    }

    /// Reads from the link: the length of a message, or a message. Fails during a handshake that takes too long.
    pub async fn read<T>(&self, read: impl Future<Output = ZResult<T>>) -> ZResult<T> {
        if self.is_over() {
            return read.await;
        }

        let result = self.step(read).await?;
        if result.is_ok() {
            self.reads.fetch_add(1, Ordering::Relaxed);
        }
        result
    }

    /// Refuses to write during a handshake that takes too long: a session is not to be opened any more, and a message that
    /// closes it would be reported as an error where it arrives when the link is whole again.
    pub fn check_write(&self) -> ZResult<()> {
        let is_late = self
            .deadline
            .is_some_and(|deadline| deadline <= Instant::now());
        if is_late && !self.is_over() {
            bail!("the handshake took too long");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::future::{pending, ready};

    use zenoh_protocol::core::EndPoint;

    use super::*;

    fn run<T>(test: impl Future<Output = T>) -> T {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .build();
        runtime.unwrap().block_on(test)
    }

    #[test]
    fn what_does_not_come_in_time_is_an_error() {
        run(async {
            let handshake = Handshake::begin(Some(Duration::from_millis(1)));
            assert!(handshake.read(pending::<ZResult<()>>()).await.is_err());
            assert!(handshake.step(pending::<()>()).await.is_err());
            assert!(handshake.check_write().is_err());
        });
    }

    #[test]
    fn a_handshake_that_is_over_is_not_late() {
        run(async {
            let handshake = Handshake::begin(Some(Duration::ZERO));
            for _ in 0..READS {
                assert!(handshake.check_write().is_err());
                // It is there already, so it is read.
                assert!(handshake.read(ready(Ok(()))).await.is_ok());
            }
            assert!(handshake.check_write().is_ok());
            // Unbounded, it is still pending after a further step of the runtime.
            let read = handshake.read(pending::<ZResult<()>>());
            let waited = tokio::time::timeout(Duration::from_millis(1), read).await;
            assert!(waited.is_err());
        });
    }

    #[test]
    fn a_failed_read_does_not_count() {
        run(async {
            let handshake = Handshake::begin(Some(Duration::ZERO));
            for _ in 0..READS {
                let failed: ZResult<()> = handshake.read(ready(Err(zerror!("").into()))).await;
                assert!(failed.is_err());
            }
            assert!(!handshake.is_over());
        });
    }

    #[test]
    fn an_endpoint_sets_the_limit_or_none() {
        let limit = |text: &str| {
            let endpoint: EndPoint = text.parse().unwrap();
            handshake_limit(&endpoint.config())
        };
        assert_eq!(
            limit("tcp/[::1]:7447#handshake_ms=300;so_sndbuf=65000").unwrap(),
            Some(Duration::from_millis(300))
        );
        assert_eq!(limit("tcp/[::1]:7447").unwrap(), None);
        assert!(limit("tcp/[::1]:7447#handshake_ms=soon").is_err());
    }
}
