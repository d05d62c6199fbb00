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
//! Binds session ids to certificates. The middleware takes a peer to be who its session id says, whatever certificate the
//! link shows: with another participant's id, which every message carries, a peer could take the place of its session. Here
//! the first certificate that opens a session with an id owns the id, and a session that shows another one is refused.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::{
        atomic::{AtomicU8, Ordering},
        LazyLock, Mutex, PoisonError,
    },
};

use zenoh_link_commons::LinkAuthId;
use zenoh_protocol::transport::{id, init::flag};
use zenoh_result::{bail, ZResult};

/// Ids that a certificate owns at most. With a further one it loses its oldest.
const MAX_IDS: usize = 1024;
/// Bytes of a session id; shorter ones are filled up with zeros.
const ID_BYTES: usize = 16;

type SessionId = [u8; ID_BYTES];

/// Who owns which id, in this process.
static OWNERS: LazyLock<Mutex<Owners>> = LazyLock::new(Mutex::default);

#[derive(Debug, Default)]
struct Owners {
    by_id: BTreeMap<SessionId, String>,
    by_owner: BTreeMap<String, VecDeque<SessionId>>,
}

impl Owners {
    /// Whether `name` owns `id`, from now on if nobody else does.
    fn admit(&mut self, id: SessionId, name: &str) -> bool {
        if let Some(owner) = self.by_id.get(&id) {
            return owner == name;
        }

        let ids = self.by_owner.entry(name.to_owned()).or_default();
        if ids.len() == MAX_IDS {
            if let Some(oldest) = ids.pop_front() {
                self.by_id.remove(&oldest);
            }
        }
        ids.push_back(id);
        self.by_id.insert(id, name.to_owned());
        true
    }
}

/// How far a peer has come that connected here. It sends the length of its first message, then that message, which has its
/// session id.
#[derive(Debug, Default)]
pub(crate) struct Opening {
    reads: AtomicU8,
}

impl Opening {
    /// Looks at what was read next from a link that shows the certificate `auth`.
    pub(crate) fn check(&self, bytes: &[u8], auth: &LinkAuthId) -> ZResult<()> {
        let reads = self.reads.load(Ordering::Relaxed);
        if reads > 1 {
            return Ok(());
        }
        self.reads.store(reads + 1, Ordering::Relaxed);
        if reads == 0 {
            return Ok(());
        }

        let LinkAuthId::Tls(Some(name)) = auth else {
            return Ok(()); // Certificates are not asked for.
        };
        let Some(id) = session_id(bytes) else {
            bail!("the first message of a session of {name} has no session id");
        };
        let mut owners = OWNERS.lock().unwrap_or_else(PoisonError::into_inner);
        if !owners.admit(id, name) {
            tracing::warn!("refused a session with the certificate of {name}: its session id is another participant's");
            bail!("the session id is another participant's");
        }
        Ok(())
    }
}

/// The session id in an `InitSyn` message: header, version, length of the id less 1 in the upper half of a byte, id.
fn session_id(message: &[u8]) -> Option<SessionId> {
    let [header, _version, lengths, rest @ ..] = message else {
        return None;
    };
    if header & 0x1f != id::INIT || header & flag::A != 0 {
        return None;
    }

    let length = 1 + usize::from(lengths >> 4);
    let mut id = SessionId::default();
    id[..length].copy_from_slice(rest.get(..length)?);
    Some(id)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_belongs_to_the_certificate_that_used_it_first() {
        let mut owners = Owners::default();
        assert!(owners.admit([1; ID_BYTES], "Leguin"));
        assert!(owners.admit([1; ID_BYTES], "Leguin"));
        assert!(!owners.admit([1; ID_BYTES], "Eve"));
    }

    #[test]
    fn a_certificate_loses_its_own_oldest_id_only() {
        let mut owners = Owners::default();
        owners.admit([1; ID_BYTES], "Leguin");
        for number in 0..=MAX_IDS as u64 {
            let mut id = [2; ID_BYTES];
            id[..8].copy_from_slice(&number.to_le_bytes());
            assert!(owners.admit(id, "Eve"));
        }
        assert_eq!(owners.by_id.len(), MAX_IDS + 1);
        assert!(!owners.admit([1; ID_BYTES], "Eve"));
    }

    #[test]
    fn a_short_id_is_the_same_with_zeros_behind() {
        let short = session_id(&[id::INIT, 9, 0x12, 7, 8]);
        let long = session_id(&[id::INIT, 9, 0x32, 7, 8, 0, 0]);
        assert_eq!(short, long);
        assert!(short.is_some());
        assert_eq!(session_id(&[id::INIT, 9, 0x32, 7, 8, 0]), None);
        assert_eq!(session_id(&[id::INIT | flag::A, 9, 0x02, 7]), None);
    }
}
