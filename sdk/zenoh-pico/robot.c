/* A robot's place in the lock-step, over zenoh-pico and Jansson. The comments name the rules of docs/protocol.md. It asks no other robot. */
#define _POSIX_C_SOURCE 200809L
#include "robot.h"

#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zenoh-pico.h>

#define KEPT_NEWS 64
typedef struct { json_int_t epoch, tick; } Moment;
typedef struct { Moment at; json_int_t flags; const char *end; } Clock;
typedef struct { Moment at; json_int_t joined, rejoin; bool is_corrected; int blocked; Point location; json_t *commands, *message; } News;
typedef enum { CLOCK, NEWS, SIMULATOR } Kind;
typedef struct { Kind kind; z_owned_sample_t sample; } Arrival;

static const char *name = "Robot", *run = "default";
static z_owned_session_t session;
static z_owned_liveliness_token_t token;
static z_owned_publisher_t report_publisher, state_publisher;
static int arrivals[2]; /* a pipe: zenoh's thread writes, the main thread reads */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static json_t *states[2]; /* the last two, under the lock: in a tick everybody sees the one before it (query.tick) */

static json_t *welcome;
static json_int_t epoch, generation, news_flag;
static bool is_seated, has_rejoined, must_join;
static Clock pending, later; /* of epoch 0: none */
static News kept[KEPT_NEWS];
static size_t kept_count;
static Moment answered;
static Point proposed;
static char *state_text, *report_text;

static int compare(Moment one, Moment other)
{
    if (one.epoch != other.epoch) return one.epoch < other.epoch ? -1 : 1;
    return (one.tick > other.tick) - (one.tick < other.tick);
}

static double patience_ms(const char *variable, double otherwise_s)
{
    return 1e3 * (getenv(variable) ? strtod(getenv(variable), NULL) : otherwise_s);
}

/* Takes the token back and closes the session, and ends. */
static _Noreturn void leave(const char *reason, const char *more)
{
    z_drop(z_move(token));
    z_drop(z_move(session));
    if (reason) fprintf(stderr, "error: %s: %s%s\n", name, reason, more);
    exit(reason ? EXIT_FAILURE : EXIT_SUCCESS);
}

/* A key of this run. Its text is kept: views refer to it. */
static z_view_keyexpr_t key_of(const char *format, ...)
{
    char path[192], text[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(path, sizeof path, format, arguments);
    va_end(arguments);
    snprintf(text, sizeof text, "cars/%s/%s", run, path);
    z_view_keyexpr_t key;
    char *kept_text = strdup(text);
    if (!kept_text || z_view_keyexpr_from_str(&key, kept_text) < 0) leave("its name or its run is no key: ", text);
    return key;
}

/* ---- Reading: what is not as it must be changes nothing (robust.malformed, number.integers). ---- */

/* `null` is as if it were absent (compat.unknown-fields). */
static void drop_nulls(json_t *object)
{
    void *next;
    const char *field;
    json_t *value;
    json_object_foreach_safe(object, next, field, value) {
        if (json_is_null(value)) json_object_del(object, field);
    }
}

/* Payloads may have integers that `json_int_t` cannot hold. Then all are read as doubles, and those of our own turned back. */
static json_t *parse(const z_loaned_bytes_t *payload)
{
    z_owned_string_t text;
    json_error_t error;
    if (z_bytes_to_string(payload, &text) < 0) return NULL;
    json_t *message = json_loadb(z_string_data(z_loan(text)), z_string_len(z_loan(text)), JSON_ALLOW_NUL, &error);
    if (!message && json_error_code(&error) == json_error_numeric_overflow) {
        int flags = JSON_ALLOW_NUL | JSON_DECODE_INT_AS_REAL;
        message = json_loadb(z_string_data(z_loan(text)), z_string_len(z_loan(text)), flags, &error);
        for (const char **field = (const char *[]){"epoch", "tick", "joined", "rejoin", NULL}; *field; field++) {
            const json_t *value = json_object_get(message, *field);
            if (value) json_object_set_new(message, *field, json_integer((json_int_t)json_number_value(value)));
        }
    }
    z_drop(z_move(text));
    drop_nulls(message);
    drop_nulls(json_object_get(message, "correction"));
    return message;
}

static bool is_whole(json_int_t value) { return value >= 0 && value < (json_int_t)1 << 53; }

static bool is_text(const json_t *value) { return json_is_string(value) && json_string_length(value) <= 4096; }

static bool read_clock(json_t *message, Clock *clock)
{
    *clock = (Clock){0};
    if (json_unpack(message, "{s:I,s:I,s?I,s?s}", "epoch", &clock->at.epoch, "tick", &clock->at.tick, "news", &clock->flags,
                    "end", &clock->end)) return false;
    return is_whole(clock->at.epoch) && is_whole(clock->at.tick) && is_whole(clock->flags) &&
           (!clock->end || !strcmp(clock->end, "finished") || !strcmp(clock->end, "stopped") || !strcmp(clock->end, "aborted"));
}

static bool read_news(json_t *message, News *news)
{
    size_t index;
    json_t *command, *correction = NULL;
    *news = (News){.message = message};
    if (json_unpack(message, "{s:I,s:I,s?I,s?I,s?o,s?o}", "epoch", &news->at.epoch, "tick", &news->at.tick, "joined", &news->joined,
                    "rejoin", &news->rejoin, "correction", &correction, "commands", &news->commands)) return false;
    news->is_corrected = correction != NULL;
    if (correction && json_unpack(correction, "{s:{s:F,s:F},s?b}", "location", "x", &news->location.x, "y", &news->location.y,
                                  "blocked", &news->blocked)) return false;
    json_array_foreach(news->commands, index, command) {
        if (!is_text(json_object_get(command, "from")) || !is_text(json_object_get(command, "command"))) return false;
    }
    return is_whole(news->at.epoch) && is_whole(news->at.tick) && is_whole(news->joined) && is_whole(news->rejoin) &&
           (!news->commands || json_is_array(news->commands));
}

/* ---- On zenoh's thread. ---- */

static void hand_over(z_loaned_sample_t *sample, void *kind)
{
    Arrival arrival = {.kind = *(const Kind *)kind};
    z_sample_clone(&arrival.sample, sample);
    if (write(arrivals[1], &arrival, sizeof arrival) != sizeof arrival) abort();
}

/* A parameter of a query, -1 if it is absent; false if it is not a whole number. */
static bool parameter(const char *parameters, const char *key, json_int_t *value)
{
    *value = -1;
    for (const char *at = parameters; at; at = strchr(at, ';') ? strchr(at, ';') + 1 : NULL) {
        if (strncmp(at, key, strlen(key))) continue;
        const char *digits = at + strlen(key);
        size_t count = strspn(digits, "0123456789");
        if (!count || count > 15 || (digits[count] && digits[count] != ';')) return false;
        *value = strtoll(digits, NULL, 10);
    }
    return true;
}

/* The state that answers a query: the newest, or with `tick=T` that of T - 1. */
static json_t *asked_for(const char *parameters)
{
    json_int_t tick, of_epoch, own_tick, own_epoch;
    if (!parameter(parameters, "tick=", &tick) || !parameter(parameters, "epoch=", &of_epoch)) return NULL;
    for (int which = 1; which >= 0; which--) {
        if (json_unpack(states[which], "{s:I,s:I}", "epoch", &own_epoch, "tick", &own_tick)) continue;
        if ((of_epoch < 0 || of_epoch == own_epoch) && (tick < 0 || tick - 1 == own_tick)) return states[which];
    }
    return NULL;
}

static struct Query { const char *what, *field; z_view_keyexpr_t key; } queries[] = {
    {.what = "state"},
    {.what = "location", .field = "location"},
    {.what = "speed", .field = "speed_mps"},
    {.what = "direction", .field = "direction_rad"},
    {.what = "state_variables", .field = "state_variables"},
    {.what = "emotion_state", .field = "emotion_state"},
    {.what = "behavior_state", .field = "behavior_state"},
};

/* query.at-once: also while the robot computes. query.once: one reply, on the key of the queryable. */
static void on_query(z_loaned_query_t *query, void *context)
{
    const struct Query *asked = context;
    z_view_string_t view;
    z_owned_bytes_t payload;
    z_query_parameters(query, &view);
    char *parameters = strndup(z_string_data(z_loan(view)), z_string_len(z_loan(view)));

    pthread_mutex_lock(&lock);
    json_t *found = asked_for(parameters), *answer = asked->field ? NULL : json_incref(found);
    if (found && asked->field)
        answer = json_pack("{s:s,s:O,s:O,s:O}", "performative", "tell", "epoch", json_object_get(found, "epoch"),
                           "tick", json_object_get(found, "tick"), "value", json_object_get(found, asked->field));
    char *text = answer ? json_dumps(answer, JSON_COMPACT) : NULL;
    json_decref(answer);
    pthread_mutex_unlock(&lock);

    z_bytes_copy_from_str(&payload, text ? text : "that tick is not known here: it is over, or not reported yet");
    if (text) z_query_reply(query, z_loan(asked->key), z_move(payload), NULL);
    else z_query_reply_err(query, z_move(payload), NULL);
    free(text);
    free(parameters);
}

/* ---- The place in the lock-step. ---- */

/* Takes a place in an epoch, or goes on if it is the one that it has (epoch.init, return.generation). */
static void seat(json_t *answer)
{
    json_int_t epoch_before = epoch, generation_before = generation;
    json_t *before[2] = {NULL, NULL};
    Point start;
    if (json_unpack(answer, "{s:I,s:I,s:I,s:{s:F,s:F},s?o,s?o}", "epoch", &epoch, "generation", &generation, "news_flag", &news_flag,
                    "location", "x", &start.x, "y", &start.y, "state_before", &before[0], "last_state", &before[1]))
        leave("its welcome is malformed", "");
    must_join = false;
    if (later.at.epoch == epoch) pending = later;
    later = (Clock){0};
    if (epoch == epoch_before && generation == generation_before) return;

    has_rejoined = epoch == epoch_before;
    is_seated = false;
    answered = (Moment){0, -1};
    proposed = start;
    json_decref(welcome);
    welcome = json_incref(answer);
    pthread_mutex_lock(&lock);
    for (int which = 0; which < 2; which++) {
        json_decref(states[which]);
        states[which] = json_is_object(before[which]) ? json_incref(before[which]) : NULL;
    }
    pthread_mutex_unlock(&lock);
}

/* One get on the simulator's queryable: its answer, or NULL. */
static json_t *ask(const z_loaned_keyexpr_t *key, const char *request)
{
    z_get_options_t options;
    z_owned_bytes_t payload;
    z_owned_closure_reply_t closure;
    z_owned_fifo_handler_reply_t replies;
    z_owned_reply_t reply;
    json_t *answer = NULL;
    z_get_options_default(&options);
    z_bytes_copy_from_str(&payload, request);
    options.payload = z_move(payload);
    options.timeout_ms = 2000;
    options.target = Z_QUERY_TARGET_ALL;
    options.consolidation.mode = Z_CONSOLIDATION_MODE_NONE;
    z_fifo_channel_reply_new(&closure, &replies, 4);
    z_get(z_loan(session), key, "", z_move(closure), &options);
    while (z_recv(z_loan(replies), &reply) == Z_OK) {
        if (!answer && z_reply_is_ok(z_loan(reply))) answer = parse(z_sample_payload(z_reply_ok(z_loan(reply))));
        z_drop(z_move(reply));
    }
    z_drop(z_move(replies));
    return answer;
}

/* Asks until the simulator answers (join.request, join.refused). */
static void join(void)
{
    static z_owned_string_t instance;
    static z_view_keyexpr_t key;
    if (!epoch) {
        z_id_t id = z_info_zid(z_loan(session));
        z_id_to_string(&id, &instance);
        key = key_of("join/%s", name);
    }
    json_t *request = json_pack("{s:i,s:s,s:s,s:s%,s:s}", "protocol", 2, "run", run, "name", name, "instance",
                                z_string_data(z_loan(instance)), z_string_len(z_loan(instance)), "sdk", "zenoh-pico");
    char *text = json_dumps(request, JSON_COMPACT);
    json_decref(request);
    z_clock_t begun = z_clock_now();
    for (bool is_welcome = false; !is_welcome;) {
        json_t *answer = ask(z_loan(key), text);
        const char *reason = json_string_value(json_object_get(answer, "reason"));
        bool is_late = !epoch && (double)z_clock_elapsed_ms(&begun) > patience_ms("CARS_PATIENCE_S", 20);
        is_welcome = answer && !reason;
        if (reason && (strcmp(reason, "name_taken") || epoch || is_late))
            leave("it may not join: ", json_string_value(json_object_get(answer, "explanation")));
        if (!answer && is_late) leave("no simulator answers for the run ", run);
        if (is_welcome) seat(answer);
        else z_sleep_ms(100);
        json_decref(answer);
    }
    free(text);
}

static void put(const z_loaned_publisher_t *publisher, const char *text)
{
    z_owned_bytes_t payload;
    z_bytes_copy_from_str(&payload, text);
    z_publisher_put(publisher, z_move(payload), NULL);
}

/* Puts what came of the last tick; again, byte for byte the same (tick.state-first, tick.answer, clock.duplicate). */
static void answer_clock(void)
{
    put(z_loan(state_publisher), state_text);
    put(z_loan(report_publisher), report_text);
}

static void run_tick(Moment at, const News *news)
{
    if (!is_seated) robot_init(welcome);
    is_seated = true;
    answered = at;
    Point stands = news && news->is_corrected ? news->location : proposed; /* tick.correction */
    Perceived perceived = {at.tick, stands, news && news->blocked, news ? news->commands : NULL};
    json_t *log = json_array();
    proposed = stands;
    json_t *report = robot_tick(&perceived, &proposed, log);
    json_object_update_new(report, json_pack("{s:I,s:I}", "epoch", at.epoch, "tick", at.tick));
    json_t *state = json_copy(report);
    json_object_update_new(state, json_pack("{s:{s:f,s:f}}", "location", "x", stands.x, "y", stands.y));
    json_object_update_new(report, json_pack("{s:I,s:{s:f,s:f},s:o}", "generation", generation, "proposal", "x", proposed.x,
                                             "y", proposed.y, "log", log));

    free(state_text);
    free(report_text);
    state_text = json_dumps(state, JSON_COMPACT);
    report_text = json_dumps(report, JSON_COMPACT);
    if (!state_text || !report_text) leave("its answer is no JSON: a number that is not finite, or no object", "");
    json_decref(report);
    pthread_mutex_lock(&lock);
    json_decref(states[0]);
    states[0] = states[1];
    states[1] = state;
    pthread_mutex_unlock(&lock);
    answer_clock();
}

/* Runs the newest clock, if its news are here and it is this robot's turn (news.wait, epoch.late). */
static void advance(void)
{
    const News *news = NULL;
    size_t left = 0;
    if (!pending.at.epoch || must_join) return;
    for (size_t index = 0; index < kept_count; index++) {
        if (!compare(kept[index].at, pending.at)) news = &kept[index];
    }
    if ((pending.flags & news_flag) && !news) return; /* They are repeated with the clock. */
    bool begins = pending.at.tick == 0 && generation == 1 && !has_rejoined;
    bool is_named = news && news->joined == generation;
    if (pending.at.epoch == epoch && (is_seated || begins || is_named)) run_tick(pending.at, news);
    for (size_t index = 0; index < kept_count; index++) {
        if (compare(kept[index].at, pending.at) > 0) kept[left++] = kept[index];
        else json_decref(kept[index].message);
    }
    kept_count = left;
    pending = (Clock){0};
}

/* end.clock, epoch.init, clock.late, clock.duplicate */
static void take_clock(Clock clock)
{
    if (clock.end) leave(NULL, NULL);
    if (clock.at.epoch > epoch) {
        must_join = true;
        if (compare(clock.at, later.at) >= 0) later = clock;
    } else if (clock.at.epoch == epoch && !compare(clock.at, answered)) {
        answer_clock();
    } else if (clock.at.epoch == epoch && compare(clock.at, answered) > 0 && compare(clock.at, pending.at) >= 0) {
        pending = clock;
    }
}

/* return.replaced, return.rejoin. Of two for the same moment the later counts. */
static void take_news(News news)
{
    bool is_of_epoch = news.at.epoch == epoch;
    if (is_of_epoch && news.joined > generation && !must_join) leave("another process has replaced it", "");
    must_join |= is_of_epoch && news.rejoin == generation;
    if (compare(news.at, answered) <= 0) return;
    if (kept_count == KEPT_NEWS) {
        json_decref(kept[0].message);
        memmove(kept, kept + 1, --kept_count * sizeof *kept);
    }
    json_incref(news.message);
    kept[kept_count++] = news;
}

static void take(const Arrival *arrival)
{
    Clock clock;
    News news;
    json_t *message = parse(z_sample_payload(z_loan(arrival->sample)));
    if (arrival->kind == CLOCK && read_clock(message, &clock)) take_clock(clock);
    else if (arrival->kind == NEWS && read_news(message, &news)) take_news(news);
    else fprintf(stderr, "%s: a malformed %s\n", name, arrival->kind == CLOCK ? "clock" : "message of news");
    json_decref(message);
}

/* ---- The session. Settings of the page that zenoh-pico does not take here are options of its build. ---- */

static void open_session(void)
{
    z_clock_t begun = z_clock_now();
    const char *endpoint = getenv("CARS_CONNECT") ? getenv("CARS_CONNECT") : "tcp/127.0.0.1:7447";
    for (;; z_sleep_ms(100)) {
        z_owned_config_t config;
        z_config_default(&config);
        zp_config_insert(z_loan_mut(config), Z_CONFIG_MODE_KEY, "client");
        zp_config_insert(z_loan_mut(config), Z_CONFIG_CONNECT_KEY, endpoint);
        if (z_open(&session, z_move(config), NULL) == Z_OK) return;
        if ((double)z_clock_elapsed_ms(&begun) > patience_ms("CARS_PATIENCE_S", 20)) leave("nothing answers at ", endpoint);
    }
}

static void subscribe(z_view_keyexpr_t key, const Kind *kind)
{
    z_owned_closure_sample_t closure;
    z_liveliness_subscriber_options_t with_history = {.history = true};
    z_closure(&closure, hand_over, NULL, (void *)kind);
    int failed = *kind == SIMULATOR
        ? z_liveliness_declare_background_subscriber(z_loan(session), z_loan(key), z_move(closure), &with_history)
        : z_declare_background_subscriber(z_loan(session), z_loan(key), z_move(closure), NULL);
    if (failed) leave("it cannot subscribe", "");
}

static void declare_publisher(z_owned_publisher_t *publisher, z_view_keyexpr_t key)
{
    z_publisher_options_t options;
    z_publisher_options_default(&options);
    options.congestion_control = Z_CONGESTION_CONTROL_BLOCK; /* wire.qos */
    if (z_declare_publisher(z_loan(session), publisher, z_loan(key), &options)) leave("it cannot declare a publisher", "");
}

/* First everything that listens, so that no message is missed. */
static void declare_all(void)
{
    static const Kind kinds[] = {CLOCK, NEWS, SIMULATOR};
    subscribe(key_of("clock"), &kinds[0]);
    subscribe(key_of("robot/%s/news", name), &kinds[1]);
    subscribe(key_of("alive/sim"), &kinds[2]);
    for (size_t index = 0; index < sizeof queries / sizeof *queries; index++) {
        z_owned_closure_query_t closure;
        queries[index].key = key_of("robot/%s/%s", name, queries[index].what);
        z_closure(&closure, on_query, NULL, &queries[index]);
        if (z_declare_background_queryable(z_loan(session), z_loan(queries[index].key), z_move(closure), NULL))
            leave("it cannot declare a queryable", "");
    }
    declare_publisher(&report_publisher, key_of("robot/%s/report", name));
    declare_publisher(&state_publisher, key_of("robot/%s/state", name));
}

int main(int argc, char **argv)
{
    for (int index = 1; index + 1 < argc; index++) {
        if (!strcmp(argv[index], "--name")) name = argv[index + 1];
    }
    if (getenv("CARS_RUN")) run = getenv("CARS_RUN");
    if (pipe(arrivals)) leave("it has no pipe", "");
    open_session();
    declare_all();
    join();
    /* join.ready-last: who sees the token knows that all of the above is in effect. */
    z_view_keyexpr_t own = key_of("alive/robot/%s", name);
    if (z_liveliness_declare_token(z_loan(session), &token, z_loan(own), NULL)) leave("it cannot declare its token", "");

    bool is_alone = false;
    z_clock_t since = z_clock_now();
    for (;;) {
        struct pollfd input = {.fd = arrivals[0], .events = POLLIN};
        double left_ms = patience_ms("CARS_GONE_PATIENCE_S", 600) - (double)z_clock_elapsed_ms(&since);
        if (is_alone && left_ms <= 0) leave("the simulator has been gone for too long", ""); /* end.gone */
        /* Of several clocks that have arrived only the newest is run. */
        for (int wait_ms = is_alone ? (int)left_ms + 1 : -1; poll(&input, 1, wait_ms) > 0; wait_ms = 0) {
            Arrival arrival;
            if (read(arrivals[0], &arrival, sizeof arrival) != sizeof arrival) leave("its pipe is broken", "");
            if (arrival.kind == SIMULATOR) {
                is_alone = z_sample_kind(z_loan(arrival.sample)) != Z_SAMPLE_KIND_PUT;
                since = z_clock_now();
            } else {
                take(&arrival);
            }
            z_drop(z_move(arrival.sample));
        }
        if (must_join) join();
        advance();
    }
}
