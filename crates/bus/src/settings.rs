//! The settings of the middleware that were measured to suit a lock-step system. One table, for sessions that need no
//! file and for the files that `cars secure init` writes; `configs/zenoh/` says the same.

/// One of the middleware's settings.
pub(crate) struct MiddlewareSetting {
    /// Its path.
    pub(crate) key: &'static str,
    /// Its value, as JSON5.
    pub(crate) value: &'static str,
    /// Why it is what it is.
    pub(crate) why: &'static str,
}

const fn setting(key: &'static str, value: &'static str, why: &'static str) -> MiddlewareSetting {
    MiddlewareSetting { key, value, why }
}

/// How those who connect take part; never a file's affair.
pub(crate) const CLIENT_MODE: MiddlewareSetting = setting(
    "mode",
    "\"client\"",
    "Everything goes by the simulator, which checks it.",
);

/// How those to whom others connect take part; never a file's affair.
pub(crate) const ROUTER_MODE: MiddlewareSetting = setting(
    "mode",
    "\"router\"",
    "All processes connect here, and to no other process.",
);

/// What every session is set to, unless a configuration file says otherwise.
pub(crate) const SETTINGS: [MiddlewareSetting; 13] = [
    setting(
        "scouting/delay",
        "0",
        "A router waits half a second for scouting that is switched off below.",
    ),
    setting(
        "scouting/multicast/enabled",
        "false",
        "Nobody is looked for: the endpoint says where to go.",
    ),
    setting(
        "scouting/gossip/enabled",
        "false",
        "One path between any two keeps messages in order.",
    ),
    setting(
        "timestamping/enabled",
        "false",
        "No wall clock has a part in a run; a clock that is set back gave two warnings for each message.",
    ),
    setting(
        "transport/link/tx/lease",
        "2000",
        "A process that hangs or a link that is cut is noticed within this time, milliseconds.",
    ),
    setting(
        "transport/link/tx/keep_alive",
        "4",
        "Signs of life within that time.",
    ),
    setting(
        "transport/link/tx/queue/congestion_control/block/wait_before_close",
        "500000",
        "A receiver that does not read holds the sender for at most this long, microseconds.",
    ),
    setting(
        "transport/link/rx/max_message_size",
        "4194304",
        "Bytes; nothing here is nearly as long.",
    ),
    setting(
        "transport/unicast/accept_pending",
        "1000",
        "Hundreds of robots may connect at the same moment.",
    ),
    setting(
        "transport/unicast/max_sessions",
        "2000",
        "No more sessions than this.",
    ),
    setting(
        "transport/unicast/accept_timeout",
        "2000",
        "A connection that sends nothing is closed after this time, milliseconds.",
    ),
    setting(
        "transport/unicast/open_timeout",
        "1000",
        "An attempt to connect into a cut link must not outlive the cut for long, milliseconds. It takes three round \
         trips to succeed: where one takes more than 0.3 s, say more.",
    ),
    setting(
        "connect/retry",
        "{ period_init_ms: 100, period_max_ms: 200, period_increase_factor: 2 }",
        "So a link that is whole again is found within about a second: the rest of an attempt and the longest wait.",
    ),
];

/// Settings in addition, where no link is ever cut, and processes may be slow.
pub(crate) const PATIENT_SETTINGS: [MiddlewareSetting; 5] = [
    setting(
        "transport/link/tx/lease",
        "60000",
        "Whoever is stopped or has no processor is still there.",
    ),
    setting(
        "transport/link/tx/keep_alive",
        "120",
        "Still two signs of life in a second: a participant over zenoh-pico gives a link up after its own lease.",
    ),
    setting(
        "transport/link/tx/queue/congestion_control/block/wait_before_close",
        "20000000",
        "So is a receiver that does not read.",
    ),
    setting(
        "transport/unicast/accept_timeout",
        "60000",
        "And one that is slow to connect.",
    ),
    setting(
        "transport/unicast/open_timeout",
        "60000",
        "The same for the side that connects.",
    ),
];
