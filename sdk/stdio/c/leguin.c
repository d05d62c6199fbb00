/*
 * Leguin, the refiller, in C: waits at the table until she is called, brings treats, hurries when she is asked to, and
 * goes home when she is sent or has had enough. Under another name she is Vonda.
 *
 *     cc -std=c11 -O2 -ffp-contract=off -o leguin leguin.c -lm
 *     cars exec --name Leguin -- ./leguin
 *
 * She speaks JSON Lines over stdin and stdout (docs/protocol.md, "Robots over stdin and stdout"), and needs nothing but
 * the C library. Her tables and her arithmetic are those of crates/robots/src/leguin, in the same order, so that a
 * run with her is, byte for byte, a run with the Leguin in Rust. Units are SI. [D] and [I] mean what they mean there:
 * documented, chosen. She allocates nothing: a line that does not fit ends her with a message.
 */

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/*
 * a * b + c rounds twice, here as in every other language. Where the machine can, a compiler may fuse it into one
 * instruction that rounds once (GCC does by itself, unless told -std=c11): another number in the last bit, and soon
 * another run. So it is forbidden here, whatever the command line forgets; and so is GCC's vectorizing, which fuses
 * (a * b - c * d, a * d + b * c) all the same (seen with GCC 12, -O3 -mfma -ffp-contract=off). Arithmetic that is wider
 * than double, or that is allowed to be sloppy, cannot be forbidden here and is refused.
 */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off", "no-tree-vectorize", "no-tree-slp-vectorize")
#else
#pragma STDC FP_CONTRACT OFF
#endif
#if FLT_EVAL_METHOD < 0 || FLT_EVAL_METHOD == 2 || defined(__FAST_MATH__)
#error "doubles must be computed as doubles: compile for SSE2 (-msse2 -mfpmath=sse) and without -ffast-math"
#endif
_Static_assert(DBL_MANT_DIG == 53 && DBL_MAX_EXP == 1024, "a double must be an IEEE 754 double");

/* Longest line, bytes, without its end: the door's limit. */
#define MAX_LINE ((size_t)1 << 20)
/* Longest text that a message may hold, bytes. */
#define MAX_TEXT ((size_t)4096)
/* Deepest nesting of a line. */
#define MAX_DEPTH 64
/* Most bodies around her that she can tell apart. */
#define MAX_BODIES ((size_t)1 << 15)

#define COUNT(list) (sizeof(list) / sizeof((list)[0]))

/* Ends her, with the reason on stderr. */
static _Noreturn void fail(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fputs("leguin: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    exit(EXIT_FAILURE);
}

/* ------------------------------------------------------------------------------------------------ chance */

/* xoshiro256++ (Blackman and Vigna): the generator behind every draw of a run. */
struct stream {
    uint64_t words[4];
};

static uint64_t rotated(uint64_t word, unsigned bits)
{
    return (word << bits) | (word >> (64 - bits));
}

static uint64_t draw(struct stream *stream)
{
    uint64_t *s = stream->words;
    uint64_t drawn = rotated(s[0] + s[3], 23) + s[0];
    uint64_t shifted = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= shifted;
    s[3] = rotated(s[3], 45);
    return drawn;
}

/* The stream of a seed: four outputs of SplitMix64. */
static struct stream seeded(uint64_t seed)
{
    struct stream stream;
    for (size_t i = 0; i < COUNT(stream.words); i++) {
        seed += UINT64_C(0x9e3779b97f4a7c15);
        uint64_t z = seed;
        z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
        z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
        stream.words[i] = z ^ (z >> 31);
    }
    return stream;
}

/* The stream that a run with this seed has under this name: the seed XOR FNV-1a of the name. */
static struct stream named(uint64_t seed, const char *name)
{
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    for (; *name; name++) {
        hash = (hash ^ (unsigned char)*name) * UINT64_C(0x100000001b3);
    }
    return seeded(seed ^ hash);
}

/* Uniform in [0, 1): the upper 53 bits of a draw. */
static double uniform(struct stream *stream)
{
    return (double)(draw(stream) >> 11) * (1.0 / 9007199254740992.0);
}

/*
 * Exponential with this mean. This decides when she jokes and nothing else: a logarithm that differs in the last bit
 * from that of another library changes nothing, unless a joke is due within 1e-15 of a tick's beginning.
 */
static double exponential(struct stream *stream, double mean)
{
    return -log(1.0 - uniform(stream)) * mean;
}

/* Uniform between half of `mean` and one and a half. */
static double around(struct stream *stream, double mean)
{
    return mean * (0.5 + uniform(stream));
}

static size_t one_of(struct stream *stream, size_t count)
{
    size_t chosen = (size_t)(uniform(stream) * (double)count);
    return chosen < count ? chosen : count - 1;
}

/* ------------------------------------------------------------------------------------------------ places */

struct point {
    double x_m, y_m;
};

/* A direction, as a unit vector: no angle is ever computed with. */
struct heading {
    double x, y;
};

static double distance_m(struct point from, struct point to)
{
    double x_m = to.x_m - from.x_m, y_m = to.y_m - from.y_m;
    return sqrt(x_m * x_m + y_m * y_m);
}

static double least(double a, double b)
{
    return b < a ? b : a;
}

static double most(double a, double b)
{
    return b > a ? b : a;
}

/* A direction, all equally probable: a place in the unit disc, drawn until it is inside and not near the middle. */
static struct heading random_heading(struct stream *stream)
{
    for (;;) {
        double x = 2.0 * uniform(stream) - 1.0;
        double y = 2.0 * uniform(stream) - 1.0;
        double square = x * x + y * y;
        if (square >= 1e-6 && square <= 1.0) {
            double length = sqrt(square);
            return (struct heading){x / length, y / length};
        }
    }
}

/* ------------------------------------------------------------------------------------------------ reading JSON */

/*
 * A line is checked once, from end to end, and then read where it stands: a value is the place of its first character,
 * and NULL is a value that is not there. What has been checked cannot run past its end, since no checked text holds a
 * NUL and every line is followed by one.
 */
typedef const char *value;

static char line[MAX_LINE + 1];

static const char *after_spaces(const char *at)
{
    while (*at == ' ' || *at == '\t' || *at == '\n' || *at == '\r') {
        at++;
    }
    return at;
}

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static const char *after_digits(const char *at)
{
    if (!is_digit(*at)) {
        return NULL;
    }
    while (is_digit(*at)) {
        at++;
    }
    return at;
}

static const char *after_number(const char *at)
{
    at += *at == '-';
    at = *at == '0' ? at + 1 : after_digits(at);
    if (at && *at == '.') {
        at = after_digits(at + 1);
    }
    if (at && (*at == 'e' || *at == 'E')) {
        at++;
        at += *at == '+' || *at == '-';
        at = after_digits(at);
    }
    return at;
}

/* The four hexadecimal digits of an escape; -1 if they are none. */
static int32_t hexadecimal(const char *at)
{
    int32_t code = 0;
    for (int i = 0; i < 4; i++) {
        static const char DIGITS[] = "0123456789abcdef0123456789ABCDEF";
        const char *digit = at[i] ? strchr(DIGITS, at[i]) : NULL;
        if (!digit) {
            return -1;
        }
        code = code * 16 + (int32_t)((digit - DIGITS) % 16);
    }
    return code;
}

/* Behind a sequence of UTF-8 of more than one byte (RFC 3629: nothing overlong, no surrogates). */
static const char *after_sequence(const char *text)
{
    const unsigned char *at = (const unsigned char *)text;
    unsigned first = at[0], low = 0x80, high = 0xbf;
    int more = first < 0xe0 ? 1 : first < 0xf0 ? 2 : 3;
    if (first < 0xc2 || first > 0xf4) {
        return NULL;
    }
    switch (first) {
    case 0xe0: low = 0xa0; break;
    case 0xed: high = 0x9f; break;
    case 0xf0: low = 0x90; break;
    case 0xf4: high = 0x8f; break;
    default: break;
    }
    for (int i = 1; i <= more; i++, low = 0x80, high = 0xbf) {
        if (at[i] < low || at[i] > high) {
            return NULL;
        }
    }
    return text + 1 + more;
}

/* Behind one character of a string, and what it is: a code point. NULL if it is none that may stand in a string. */
static const char *after_character(const char *at, uint32_t *code)
{
    static const char ESCAPES[] = "\"\\/bfnrt", MEANT[] = "\"\\/\b\f\n\r\t";
    unsigned char c = (unsigned char)*at;
    if (c == '\\' && at[1] == 'u') {
        int32_t unit = hexadecimal(at + 2), low = -1;
        if (unit >= 0xd800 && unit <= 0xdbff && at[6] == '\\' && at[7] == 'u') {
            low = hexadecimal(at + 8);
        }
        if (low >= 0xdc00 && low <= 0xdfff) {
            *code = 0x10000 + (((uint32_t)unit - 0xd800) << 10) + ((uint32_t)low - 0xdc00);
            return at + 12;
        }
        *code = (uint32_t)unit;
        return unit < 0 || (unit >= 0xd800 && unit <= 0xdfff) ? NULL : at + 6;
    }
    if (c == '\\') {
        const char *escape = at[1] ? strchr(ESCAPES, at[1]) : NULL;
        *code = escape ? (unsigned char)MEANT[escape - ESCAPES] : 0;
        return escape ? at + 2 : NULL;
    }
    if (c < 0x80) {
        *code = c;
        return c < 0x20 ? NULL : at + 1;
    }
    const char *after = after_sequence(at);
    if (after) {
        uint32_t found = c & (0x7fu >> (after - at));
        for (const char *rest = at + 1; rest < after; rest++) {
            found = (found << 6) | ((unsigned char)*rest & 0x3f);
        }
        *code = found;
    }
    return after;
}

static const char *after_string(const char *at)
{
    uint32_t code;
    if (*at != '"') {
        return NULL;
    }
    at++;
    while (at && *at != '"') {
        at = after_character(at, &code);
    }
    return at ? at + 1 : NULL;
}

static const char *after_value(const char *at, int depth);

static const char *after_container(const char *at, int depth)
{
    bool is_object = *at == '{';
    char close = is_object ? '}' : ']';
    at = after_spaces(at + 1);
    if (*at == close) {
        return at + 1;
    }
    for (;;) {
        if (is_object) {
            at = after_string(at);
            at = at ? after_spaces(at) : NULL;
            if (!at || *at != ':') {
                return NULL;
            }
            at = after_spaces(at + 1);
        }
        at = after_value(at, depth);
        at = at ? after_spaces(at) : NULL;
        if (!at || (*at != close && *at != ',')) {
            return NULL;
        }
        if (*at == close) {
            return at + 1;
        }
        at = after_spaces(at + 1);
    }
}

/* Behind the value that begins here; NULL if none does. */
static const char *after_value(const char *at, int depth)
{
    static const char *const WORDS[] = {"true", "false", "null"};
    if (*at == '{' || *at == '[') {
        return depth < MAX_DEPTH ? after_container(at, depth + 1) : NULL;
    }
    if (*at == '"') {
        return after_string(at);
    }
    for (size_t i = 0; i < COUNT(WORDS); i++) {
        if (strncmp(at, WORDS[i], strlen(WORDS[i])) == 0) {
            return at + strlen(WORDS[i]);
        }
    }
    return after_number(at);
}

/* A walk over the members of an object or the elements of a list. Begins before the first one. */
struct walk {
    const char *at;
    /* The name of the member, a string with its quotes. */
    value name;
    value value;
};

static struct walk walk_over(value container)
{
    bool is_container = container && (*container == '{' || *container == '[');
    return (struct walk){is_container ? container : NULL, NULL, NULL};
}

/* Goes to the next one; no, if there is none. */
static bool next(struct walk *walk)
{
    if (!walk->at || *walk->at == '}' || *walk->at == ']') {
        return false;
    }
    /* Here is the opening bracket, or a comma. */
    const char *at = after_spaces(walk->at + 1);
    if (*at == '}' || *at == ']') {
        return false;
    }
    bool is_object = walk->name || (*walk->at == '{');
    if (is_object) {
        walk->name = at;
        at = after_spaces(after_spaces(after_string(at)) + 1);
    }
    walk->value = at;
    walk->at = after_spaces(after_value(at, 0));
    return true;
}

/* Whether a value is this text. */
static bool is_text(value string, const char *wanted)
{
    if (!string || *string != '"') {
        return false;
    }
    uint32_t code;
    /* What is compared with is plain ASCII. */
    for (string++; *string != '"'; wanted++) {
        string = after_character(string, &code);
        if (!*wanted || code != (unsigned char)*wanted) {
            return false;
        }
    }
    return !*wanted;
}

static value member(value object, const char *name)
{
    struct walk walk = walk_over(object && *object == '{' ? object : NULL);
    while (next(&walk)) {
        if (is_text(walk.name, name)) {
            return *walk.value == 'n' ? NULL : walk.value;
        }
    }
    return NULL;
}

static bool is_true(value at)
{
    return at && *at == 't';
}

/* Reads a number; no, if it is none or not finite. */
static bool read_number(value at, double *number)
{
    if (!at || !(*at == '-' || is_digit(*at))) {
        return false;
    }
    /* Correctly rounded, so that what was written is read, to the last bit. The locale is "C", since none is set. */
    *number = strtod(at, NULL);
    return isfinite(*number);
}

static bool read_point(value at, struct point *point)
{
    return read_number(member(at, "x"), &point->x_m) && read_number(member(at, "y"), &point->y_m);
}

/* Text in UTF-8, which may hold a NUL; one stands behind it. */
struct text {
    size_t length;
    char bytes[MAX_TEXT + 1];
};

static void append(struct text *text, const char *bytes, size_t length)
{
    if (length > MAX_TEXT - text->length) {
        fail("text of more than %zu bytes", MAX_TEXT);
    }
    memcpy(text->bytes + text->length, bytes, length);
    text->length += length;
    text->bytes[text->length] = '\0';
}

static void append_character(struct text *text, uint32_t code)
{
    char bytes[4];
    size_t more = code < 0x80 ? 0 : code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
    static const unsigned FIRST[] = {0, 0xc0, 0xe0, 0xf0};
    for (size_t i = more; i > 0; i--, code >>= 6) {
        bytes[i] = (char)(0x80 | (code & 0x3f));
    }
    bytes[0] = (char)(FIRST[more] | code);
    append(text, bytes, more + 1);
}

static bool read_text(value at, struct text *text)
{
    text->length = 0;
    text->bytes[0] = '\0';
    if (!at || *at != '"') {
        return false;
    }
    for (at++; *at != '"';) {
        uint32_t code;
        at = after_character(at, &code);
        append_character(text, code);
    }
    return true;
}

/* ------------------------------------------------------------------------------------------------ writing JSON */

static void put(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vprintf(format, arguments);
    va_end(arguments);
}

/* A piece of a string, without quotes. */
static void put_piece(const char *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        unsigned char c = (unsigned char)bytes[i];
        if (c == '"' || c == '\\') {
            put("\\%c", c);
        } else if (c < 0x20) {
            put("\\u%04x", c);
        } else {
            putchar(c);
        }
    }
}

static void put_bytes(const char *bytes, size_t length)
{
    putchar('"');
    put_piece(bytes, length);
    putchar('"');
}

static void put_text(const char *text)
{
    put_bytes(text, strlen(text));
}

/* The fewest digits that are read as this number again, to the last bit: 17 always do. */
static void put_number(double number)
{
    char digits[32];
    if (!isfinite(number)) {
        fail("a number of hers is not finite");
    }
    for (int precision = 15; precision <= 17; precision++) {
        snprintf(digits, sizeof digits, "%.*g", precision, number);
        if (strtod(digits, NULL) == number) {
            break;
        }
    }
    put("%s", digits);
}

static void put_flag(bool flag)
{
    put("%s", flag ? "true" : "false");
}

/* ------------------------------------------------------------------------------------------------ the door */

/* What was put goes out. */
static void flush(void)
{
    if (fflush(stdout) != 0 || ferror(stdout)) {
        fail("cannot write to stdout: %s", strerror(errno));
    }
}

/* Reads a line and checks that it is a JSON object; no, at the end of the input. */
static bool read_line(void)
{
    size_t length = 0;
    int c;
    while ((c = getchar()) != EOF && c != '\n') {
        if (length == MAX_LINE) {
            fail("a line of more than %zu bytes", MAX_LINE);
        }
        line[length++] = (char)c;
    }
    line[length] = '\0';
    if (c == EOF && length == 0) {
        return false;
    }
    const char *begin = after_spaces(line);
    const char *after = *begin == '{' ? after_value(begin, 0) : NULL;
    if (!after || after_spaces(after) != line + length) {
        fail("not a JSON object: %.80s", line);
    }
    return true;
}

static value message(void)
{
    return after_spaces(line);
}

static bool is_type(const char *type)
{
    return is_text(member(message(), "type"), type);
}

/* Waits for the answer to the question just put; NULL if there is none to be had. The line before is gone then. */
static value answer(void)
{
    flush();
    if (!read_line() || is_type("end")) {
        exit(EXIT_SUCCESS);
    }
    if (!is_type("answer")) {
        fail("an answer was to come, not: %.80s", line);
    }
    return member(message(), "value");
}

static void say(const char *bytes, size_t length)
{
    put("{\"type\":\"log\",\"text\":");
    put_bytes(bytes, length);
    put("}\n");
}

/* ------------------------------------------------------------------------------------------------ her parameters */

#define FT_M 0.3048

/* What her speed and her giving up follow from. By RULES she also hurries when her way is blocked. */
enum policy { BY_EMOTION, BY_RULES, BY_TIMER, BY_NEITHER };
static const char *const POLICY_NAMES[] = {"emotion", "rules", "timer", "neither"};

/* Names are those of configs/robots/leguin.toml, which says what each is for. */
struct parameters {
    struct text waiter, goods;
    bool affect, sensory_motor, schematic;
    enum policy policy;
    double caution, exchange_radius_m, exchange_s, v_refill_mps, hurry_mult, prep_s, block_patience_s;
    double await_patience_s, progress_m, arrive_m, settle_s, settle_m, stand_off_m, query_stale_s;
    double turn_mean_s, look_s, joke_mean_s;
    /* Of her dynamics. */
    double caution_gain_base, caution_gain_slope, th_concerned, hurry, haste_onset, haste_full, label_cuts[4];
};

enum bound { ABOVE_0, AT_LEAST_0, FROM_0_TO_1 };

struct number_parameter {
    const char *name;
    size_t place;
    enum bound bound;
    double unless_given;
};

#define NUMBER(name, bound, unless_given) {#name, offsetof(struct parameters, name), bound, unless_given}

static const struct number_parameter NUMBERS[] = {
    NUMBER(caution, FROM_0_TO_1, 0.5),
    NUMBER(exchange_radius_m, ABOVE_0, 4.0 * FT_M), /* [D] */
    NUMBER(exchange_s, AT_LEAST_0, 2.0),
    NUMBER(v_refill_mps, AT_LEAST_0, 3.0 * FT_M),
    NUMBER(hurry_mult, AT_LEAST_0, 1.5),
    NUMBER(prep_s, AT_LEAST_0, 1.0),
    NUMBER(block_patience_s, ABOVE_0, 25.0),
    NUMBER(await_patience_s, ABOVE_0, 20.0),
    NUMBER(progress_m, ABOVE_0, 0.5 * FT_M),
    NUMBER(arrive_m, AT_LEAST_0, 1.5 * FT_M),
    NUMBER(settle_s, AT_LEAST_0, 5.0),
    NUMBER(settle_m, AT_LEAST_0, 6.0 * FT_M),
    NUMBER(stand_off_m, AT_LEAST_0, 3.0 * FT_M),
    NUMBER(query_stale_s, AT_LEAST_0, 5.0),
    NUMBER(turn_mean_s, ABOVE_0, 5.0),
    NUMBER(look_s, AT_LEAST_0, 2.0),
    NUMBER(joke_mean_s, ABOVE_0, 60.0),
};

static const struct number_parameter DYNAMICS[] = {
    NUMBER(caution_gain_base, ABOVE_0, 0.5),
    NUMBER(caution_gain_slope, AT_LEAST_0, 1.0),
    NUMBER(th_concerned, AT_LEAST_0, 0.45),
    NUMBER(hurry, AT_LEAST_0, 0.6),
    NUMBER(haste_onset, AT_LEAST_0, 0.25),
    NUMBER(haste_full, AT_LEAST_0, 0.6),
};

static const struct {
    const char *name;
    size_t place;
} SWITCHES[] = {
    {"affect", offsetof(struct parameters, affect)},
    {"sensory_motor", offsetof(struct parameters, sensory_motor)},
    {"schematic", offsetof(struct parameters, schematic)},
};

static double *number_at(struct parameters *parameters, const struct number_parameter *known)
{
    return (double *)(void *)((char *)parameters + known->place);
}

static void read_bounded(struct parameters *parameters, const struct number_parameter *known, value given)
{
    static const char *const MEANING[] = {"above 0", "at least 0", "from 0 to 1"};
    double number;
    bool is_good = read_number(given, &number) && number >= 0.0;
    is_good = is_good && !(known->bound == ABOVE_0 && number == 0.0) && !(known->bound == FROM_0_TO_1 && number > 1.0);
    if (!is_good) {
        fail("parameter %s must be a number %s", known->name, MEANING[known->bound]);
    }
    *number_at(parameters, known) = number;
}

/* Reads the parameter if it is a number of this table. */
static bool read_known(struct parameters *parameters, const struct number_parameter *known, size_t count,
                       const struct walk *given)
{
    for (size_t i = 0; i < count; i++) {
        if (is_text(given->name, known[i].name)) {
            read_bounded(parameters, &known[i], given->value);
            return true;
        }
    }
    return false;
}

static bool read_switch(struct parameters *parameters, const struct walk *given)
{
    for (size_t i = 0; i < COUNT(SWITCHES); i++) {
        if (!is_text(given->name, SWITCHES[i].name)) {
            continue;
        }
        bool is_on = is_text(given->value, "on");
        if (!is_on && !is_text(given->value, "off")) {
            fail("parameter %s must be \"on\" or \"off\"", SWITCHES[i].name);
        }
        *(bool *)((char *)parameters + SWITCHES[i].place) = is_on;
        return true;
    }
    return false;
}

static void read_policy(struct parameters *parameters, value given)
{
    for (size_t i = 0; i < COUNT(POLICY_NAMES); i++) {
        if (is_text(given, POLICY_NAMES[i])) {
            parameters->policy = (enum policy)i;
            return;
        }
    }
    fail("parameter policy must be \"emotion\", \"rules\", \"timer\" or \"neither\"");
}

/* A name that she does not know is refused: a misspelled one would silently run another experiment. */
static _Noreturn void refuse(const struct walk *given)
{
    static struct text name;
    read_text(given->name, &name);
    fail("there is no parameter %s; configs/robots/leguin.toml has all of them", name.bytes);
}

static void read_dynamics(struct parameters *parameters, value given)
{
    struct walk walk = walk_over(given);
    while (next(&walk)) {
        if (is_text(walk.name, "label_cuts")) {
            struct walk cuts = walk_over(walk.value);
            size_t count = 0;
            bool is_good = true;
            for (; is_good && next(&cuts); count++) {
                double *cut = count < COUNT(parameters->label_cuts) ? &parameters->label_cuts[count] : NULL;
                is_good = cut && read_number(cuts.value, cut);
            }
            if (!is_good || count != COUNT(parameters->label_cuts)) {
                fail("parameter label_cuts must be four numbers");
            }
        } else if (!read_known(parameters, DYNAMICS, COUNT(DYNAMICS), &walk)) {
            refuse(&walk);
        }
    }
}

static void set_text(struct text *text, const char *plain)
{
    text->length = 0;
    append(text, plain, strlen(plain));
}

static void read_parameters(struct parameters *parameters, value given)
{
    static const double CUTS[] = {0.2, 0.4, 0.6, 0.8};
    set_text(&parameters->waiter, "Butler"); /* [D] */
    set_text(&parameters->goods, "treats");  /* [D] */
    parameters->affect = parameters->sensory_motor = parameters->schematic = true;
    parameters->policy = BY_EMOTION;
    memcpy(parameters->label_cuts, CUTS, sizeof CUTS);
    for (size_t i = 0; i < COUNT(NUMBERS); i++) {
        *number_at(parameters, &NUMBERS[i]) = NUMBERS[i].unless_given;
    }
    for (size_t i = 0; i < COUNT(DYNAMICS); i++) {
        *number_at(parameters, &DYNAMICS[i]) = DYNAMICS[i].unless_given;
    }
    struct walk walk = walk_over(given);
    while (next(&walk)) {
        bool is_waiter = is_text(walk.name, "waiter");
        if (is_waiter || is_text(walk.name, "goods")) {
            if (!read_text(walk.value, is_waiter ? &parameters->waiter : &parameters->goods)) {
                fail("parameters waiter and goods must be text");
            }
        } else if (is_text(walk.name, "policy")) {
            read_policy(parameters, walk.value);
        } else if (is_text(walk.name, "dynamics")) {
            read_dynamics(parameters, walk.value);
        } else if (!read_switch(parameters, &walk) && !read_known(parameters, NUMBERS, COUNT(NUMBERS), &walk)) {
            refuse(&walk);
        }
    }
    double onset = parameters->haste_onset, full = parameters->haste_full;
    if (!(onset <= full && full <= 1.0)) {
        fail("thresholds must be in ascending order within [0, 1], but %g is followed by %g", onset, full);
    }
}

/* ------------------------------------------------------------------------------------------------ her memory */

enum behavior { WAIT, REFILL, EXCHANGE, AWAIT_GO_HOME, GO_HOME, BEHAVIORS };
static const char *const BEHAVIOR_NAMES[BEHAVIORS] = {"WAIT", "REFILL", "EXCHANGE", "AWAIT_GO_HOME", "GO_HOME"};

enum emotion { HAPPY, CONFIDENT, CONCERNED, FRUSTRATED };
static const struct {
    const char *name;
    bool is_negative;
    /* What she is inclined to do, and how she accounts for it: {g} is her goal, {a} who is in its way. */
    const char *tone, *face, *tendency, *account;
} FEELINGS[] = {
    [HAPPY] = {"HAPPY", false, "good", "happy", "free-activate",
               "Something good is happening; I wanted this: {g}; because of this I feel good."},
    [CONFIDENT] = {"CONFIDENT", false, "neutral", "neutral", "continue-normal-activity",
                   "I want {g}; I think this will happen; I know what to do; because of this I feel good."},
    [CONCERNED] = {"CONCERNED", true, "warning", "fearful", "monitor-progress-closely",
                   "I want {g}; {a} is not here; something bad can happen soon; I do not want it; "
                   "I do not know if it will happen; because of this I feel bad."},
    [FRUSTRATED] = {"FRUSTRATED", true, "bad", "angry", "change-current-strategy",
                    "I want {g}; I cannot do this now; {a} is not here; I tried; "
                    "because of this I feel bad and want to do something else."},
};

/* Who is responsible for how things are: she herself, the waiter, or the crowd. */
enum agency { ONESELF, THE_WAITER, THE_CROWD };

/* Her judgment of the moment. */
struct appraisal {
    /* From -1, which prevents her goal, to 1, nothing is in the way of it. */
    double goal_congruence;
    /* How much she can do about it, and how recent what she knows is, 0 to 1. */
    double controllability, certainty;
    enum agency agency;
};

/* How near she has come to her goal on this way, and how long ago she last came nearer, s. */
struct closing {
    bool has_nearest;
    double nearest_m, stalled_s;
};

/* What she was told to do and has not begun yet. */
enum errand { NO_ERRAND, TO_REFILL, TO_HURRY };
static const char *const ERRAND_NAMES[] = {"", "refill", "hurry"};

struct measures {
    /* Whether she was told to hurry. */
    bool hurried;
    /* How strongly that concerns her. */
    double hurry;
    /* Time without progress, and time of waiting to be sent home, as shares of her patience with each. */
    double blocked, waiting;
    /* The share at which she is CONCERNED about the way. */
    double th_concerned;
};

/* Where she is heading, and how she got past the last obstacle. */
struct legs {
    struct heading heading;
    double speed_mps;
    /* The side on which she last found a way: 1 for left, -1 for right. */
    double side;
    /* For how long she goes on looking around before each step, and when her walk turns next, s. */
    double careful_s, turn_s;
};

/* The waiter, as far as he is known: by asking and by sensing. */
struct peer {
    bool has_place, is_sensed, is_missing, has_answered;
    struct point place;
    /* How long ago he last answered, and how long ago his place was last known, s. */
    double unheard_s, unseen_s;
    /* Whether he needs a refill, and whether he calls for somebody else, as he last said. */
    bool needs, calls_another;
};

/* What she was told when she joined. */
static struct {
    struct text name;
    double tick_s, width_m, height_m, body_m, sensing_range_m;
    struct parameters parameters;
} told;

/* What the tick under way has brought. */
static struct {
    bool is_blocked, senses_waiter;
    struct point waiter;
} news;

static struct {
    struct point at, home;
    struct legs legs;
    struct peer waiter;
    enum behavior behavior;
    double lasting_s;
    enum emotion emotion;
    double urgency;
    struct measures measures;
    struct appraisal appraisal;
    bool hurried, sent_home;
    enum errand pending;
    struct closing way;
    /* How long she has waited to be sent home. */
    double waiting_s;
    uint32_t trips, given_up;
    double until_joke_s;
    struct stream turns, jokes;
} her;

/* Sums of ticks such as 0.1 s fall short of what they mean by far less than the slack. */
static bool has_lasted(double needed_s)
{
    return her.lasting_s + 1e-9 >= needed_s;
}

/* ------------------------------------------------------------------------------------------------ how she moves */

static struct point stepped(struct point from, struct heading heading, double step_m)
{
    return (struct point){from.x_m + heading.x * step_m, from.y_m + heading.y * step_m};
}

/* How deep two bodies may overlap and still count as touching, as the collision rule has it. */
#define TOUCH_M 1e-9

static bool is_on_field(struct point center)
{
    double margin_m = told.body_m / 2.0 - TOUCH_M;
    return center.x_m >= margin_m && center.x_m <= told.width_m - margin_m && center.y_m >= margin_m &&
           center.y_m <= told.height_m - margin_m;
}

static struct {
    size_t count;
    struct point at[MAX_BODIES];
} bodies;

/* Asks what is around her. Without an answer the epoch is over, and nobody will use the step. */
static void look_around(void)
{
    put("{\"type\":\"percept\"}\n");
    struct walk walk = walk_over(member(answer(), "bodies"));
    for (bodies.count = 0; next(&walk); bodies.count++) {
        if (bodies.count == MAX_BODIES) {
            fail("more than %zu bodies around her", MAX_BODIES);
        }
        if (!read_point(member(walk.value, "location"), &bodies.at[bodies.count])) {
            fail("a body without a location");
        }
    }
}

static bool is_free(struct heading heading, double step_m)
{
    struct point there = stepped(her.at, heading, step_m);
    double apart_m = told.body_m - TOUCH_M;
    if (!is_on_field(there)) {
        return false;
    }
    for (size_t i = 0; i < bodies.count; i++) {
        if (fabs(bodies.at[i].x_m - there.x_m) < apart_m && fabs(bodies.at[i].y_m - there.y_m) < apart_m) {
            return false;
        }
    }
    return true;
}

/* Cosine and sine of the headings tried around the straight one, 20 to 120 degrees [I]. */
static const struct heading OFFSETS[] = {
    {0.9396926207859084, 0.3420201433256687},
    {0.766044443118978, 0.6427876096865393},
    {0.5, 0.8660254037844386},
    {0.17364817766693041, 0.984807753012208},
    {-0.17364817766693041, 0.984807753012208},
    {-0.5, 0.8660254037844386},
};

/* The heading nearest to the straight one whose step is free, on the side that worked last before the other. */
static bool find_heading(struct heading straight, double step_m, struct heading *found)
{
    *found = straight;
    if (is_free(straight, step_m)) {
        return true;
    }
    double sides[] = {her.legs.side, -her.legs.side};
    for (size_t i = 0; i < COUNT(OFFSETS); i++) {
        for (size_t j = 0; j < COUNT(sides); j++) {
            double cos = OFFSETS[i].x, sin = sides[j] * OFFSETS[i].y;
            *found = (struct heading){straight.x * cos - straight.y * sin, straight.x * sin + straight.y * cos};
            if (is_free(*found, step_m)) {
                her.legs.side = sides[j];
                return true;
            }
        }
    }
    return false;
}

static struct point stay(void)
{
    her.legs.speed_mps = 0.0;
    return her.at;
}

/* A step of a random walk: straight on, with a new heading when its time has come, when the last step was refused, or
 * where the field ends. */
static struct point walk_about(double speed_mps)
{
    /* New headings tried in a tick before she stays where she is [I]. */
    enum { TRIES = 8 };
    struct legs *legs = &her.legs;
    legs->turn_s -= told.tick_s;
    bool turns = legs->turn_s <= 0.0 || news.is_blocked;
    double step_m = speed_mps * told.tick_s;
    for (int i = 0; i < TRIES; i++, turns = true) {
        if (turns) {
            legs->heading = random_heading(&her.turns);
            legs->turn_s = around(&her.turns, told.parameters.turn_mean_s);
        }
        struct point there = stepped(her.at, legs->heading, step_m);
        if (is_on_field(there)) {
            legs->speed_mps = speed_mps;
            return there;
        }
    }
    return stay();
}

/* A step of a straight drive; for a while after a refused step she looks around first and steps aside where somebody
 * stands in the way. */
static struct point drive(struct point goal, double stop_m, double speed_mps)
{
    struct legs *legs = &her.legs;
    if (news.is_blocked) {
        legs->careful_s = most(told.parameters.look_s, told.tick_s);
    }
    double away_m = distance_m(her.at, goal);
    double step_m = least(speed_mps * told.tick_s, away_m - stop_m);
    if (step_m <= 0.0) {
        return stay();
    }
    struct heading heading, straight = {(goal.x_m - her.at.x_m) / away_m, (goal.y_m - her.at.y_m) / away_m};
    heading = straight;
    if (legs->careful_s > 0.0) {
        legs->careful_s -= told.tick_s;
        look_around();
        /* A narrow gap may take a short step where a long one does not fit. */
        double long_m = step_m * 1.0, short_m = step_m * 0.5;
        step_m = long_m;
        if (!find_heading(straight, step_m, &heading)) {
            step_m = short_m;
            if (!find_heading(straight, step_m, &heading)) {
                return stay();
            }
        }
    }
    legs->heading = heading;
    legs->speed_mps = step_m / told.tick_s;
    return stepped(her.at, heading, step_m);
}

/* Direction of her last motion. Rounded to 1e-6 rad, so that languages whose arc tangents differ in the last bit agree. */
static double direction_rad(void)
{
    double rounded = floor(atan2(her.legs.heading.y, her.legs.heading.x) * 1e6 + 0.5) / 1e6;
    /* Minus zero is another text than zero. */
    return rounded == 0.0 ? 0.0 : rounded;
}

/* ------------------------------------------------------------------------------------------------ the waiter */

/* What he says of himself, if he can be asked. */
static bool ask_waiter(struct point *place)
{
    put("{\"type\":\"query\",\"of\":");
    put_bytes(told.parameters.waiter.bytes, told.parameters.waiter.length);
    put(",\"what\":\"state\"}\n");
    value state = answer();
    if (!state) {
        return false;
    }
    if (!read_point(member(state, "location"), place)) {
        fail("a state without a location");
    }
    value said = member(state, "state_variables"), calls = member(said, "refiller");
    her.waiter.needs = is_true(member(said, "need"));
    her.waiter.calls_another = calls && *calls == '"' && !is_text(calls, told.name.bytes);
    return true;
}

/* Asks and looks: where he is sensed counts for more than where he says he was, because the answer is a tick old.
 * Without an answer, a place within sensing range at which he is not sensed is one at which he is not. */
static void watch_waiter(void)
{
    struct peer *waiter = &her.waiter;
    waiter->unheard_s += told.tick_s;
    waiter->unseen_s += told.tick_s;
    struct point place = {0.0, 0.0};
    bool answers = ask_waiter(&place);
    if (answers) {
        waiter->has_answered = true;
        waiter->unheard_s = 0.0;
    }
    waiter->is_sensed = news.senses_waiter;
    if (waiter->is_sensed) {
        place = news.waiter;
    }
    bool is_placed = answers || waiter->is_sensed;
    bool was_searched = waiter->has_place && distance_m(her.at, waiter->place) <= told.sensing_range_m;
    waiter->is_missing = !is_placed && (waiter->is_missing || was_searched);
    if (is_placed) {
        waiter->unseen_s = 0.0;
        waiter->has_place = true;
        waiter->place = place;
    }
}

/* How recent the place is at which he was last known: from 1, of this tick, to 0, too old to count or unknown. */
static double place_certainty(void)
{
    double unseen_s = her.waiter.unseen_s;
    if (!her.waiter.has_place) {
        return 0.0;
    }
    return unseen_s == 0.0 ? 1.0 : 1.0 - least(unseen_s / told.parameters.query_stale_s, 1.0);
}

/* Whether he wants treats of her. Where he cannot be asked she takes it that he does, unless he is known to call for
 * somebody else: Vonda does not step in for Leguin. */
static bool is_needed(void)
{
    bool is_unknown = !her.waiter.has_answered || her.waiter.unheard_s > told.parameters.query_stale_s;
    return !her.waiter.calls_another && (her.waiter.needs || is_unknown);
}

/* Whether he stands near enough. Sensing decides, being exact and of this tick; what he says only where sensing does
 * not reach so far. */
static bool is_waiter_here(void)
{
    double radius_m = told.parameters.exchange_radius_m;
    bool is_certain = her.waiter.is_sensed || (told.sensing_range_m < radius_m && her.waiter.unseen_s == 0.0);
    return is_certain && her.waiter.has_place && distance_m(her.at, her.waiter.place) <= radius_m;
}

/* ------------------------------------------------------------------------------------------------ what she feels */

#define IN(behavior) (1u << (behavior))

struct emotion_row {
    unsigned during;
    bool (*when)(const struct measures *);
    enum emotion feel;
};

static bool always(const struct measures *m) { (void)m; return true; }
static bool is_blocked(const struct measures *m) { return m->blocked >= 1.0; }
static bool is_pressed(const struct measures *m) { return m->hurried || m->blocked >= m->th_concerned; }
static bool waits_long(const struct measures *m) { return m->waiting >= 0.5; }
static bool waits_too_long(const struct measures *m) { return m->waiting >= 1.0; }

/* The emotion state generator: the refiller's column of the paper's Table 2. The first row that holds counts. */
static const struct emotion_row EMOTION_TABLE[] = {
    /* during                                  when            feel */
    {IN(WAIT) | IN(EXCHANGE) | IN(GO_HOME),    always,         HAPPY},
    {IN(REFILL),                               is_blocked,     FRUSTRATED},
    {IN(REFILL),                               is_pressed,     CONCERNED},
    {IN(REFILL),                               always,         CONFIDENT},
    {IN(AWAIT_GO_HOME),                        waits_too_long, FRUSTRATED},
    {IN(AWAIT_GO_HOME),                        waits_long,     CONCERNED},
    {IN(AWAIT_GO_HOME),                        always,         CONFIDENT},
};

static double clamped(double share)
{
    return share > 0.0 ? least(share, 1.0) : 0.0;
}

/* How pressing the need is [I]. */
static double urgency_of(const struct measures *m)
{
    return clamped(most(most(m->hurry, m->blocked), m->waiting));
}

/* How strongly she feels it: good feelings are strongest when nothing presses, bad ones when everything does [I]. */
static double intensity(void)
{
    return clamped(FEELINGS[her.emotion].is_negative ? her.urgency : 1.0 - her.urgency);
}

/* The same, with the sign of the feeling. */
static double valence(void)
{
    return (FEELINGS[her.emotion].is_negative ? -1.0 : 1.0) * intensity();
}

/* The waiter is responsible if he told her to hurry or keeps her waiting, and the crowd if it blocks her. */
static enum agency agency_of(const struct measures *m)
{
    return m->hurried || waits_long(m) ? THE_WAITER : m->blocked >= m->th_concerned ? THE_CROWD : ONESELF;
}

/* How she judges the moment [I]. */
static void appraise(void)
{
    const struct measures *m = &her.measures;
    her.appraisal = (struct appraisal){
        .goal_congruence = 1.0 - 2.0 * urgency_of(m),
        .controllability = 1.0 - least(m->blocked, 1.0),
        .certainty = place_certainty(),
        .agency = agency_of(m),
    };
}

static void update_emotion(void)
{
    appraise();
    if (!told.parameters.affect) {
        return;
    }
    for (size_t i = 0; i < COUNT(EMOTION_TABLE); i++) {
        if ((EMOTION_TABLE[i].during & IN(her.behavior)) && EMOTION_TABLE[i].when(&her.measures)) {
            her.emotion = EMOTION_TABLE[i].feel;
            break;
        }
    }
    her.urgency = urgency_of(&her.measures);
}

static const char *emotion_name(void)
{
    return told.parameters.affect ? FEELINGS[her.emotion].name : "NEUTRAL";
}

/* The sensory-motor level: the stronger her concern, the faster she is; nothing else changes her speed. */
static double emotional_haste(void)
{
    double onset = told.parameters.haste_onset, full = told.parameters.haste_full, felt = intensity();
    double gain = FEELINGS[her.emotion].is_negative ? told.parameters.hurry_mult : 1.0;
    double share = felt >= full ? 1.0 : felt <= onset ? 0.0 : (felt - onset) / (full - onset);
    return 1.0 + (gain - 1.0) * share;
}

/* The factor on her speed, by her policy. */
static double haste(void)
{
    switch (told.parameters.policy) {
    case BY_EMOTION:
        return told.parameters.sensory_motor ? emotional_haste() : 1.0;
    case BY_RULES:
        return her.hurried || her.measures.blocked >= her.measures.th_concerned ? told.parameters.hurry_mult : 1.0;
    case BY_TIMER:
        return her.hurried ? told.parameters.hurry_mult : 1.0;
    default:
        return 1.0;
    }
}

/* ------------------------------------------------------------------------------------------------ what she does */

/* What a row's guard can see: as it was at the beginning of the step. */
struct context {
    bool gives_up, is_happy;
    enum errand pending;
    bool waiter_is_needy_here, exchange_is_over, sent_home, is_home, has_joke;
};

enum act { NOTHING, TAKE_ERRAND, HURRY, FINISH_ERRAND, GIVE_UP, TURN_HOME, JOKE };

/* Instead of a behavior to go to: read on with the next row. */
#define STAY BEHAVIORS

struct behavior_row {
    unsigned from;
    bool (*when)(const struct context *);
    enum act act;
    enum behavior then;
};

static bool waiter_is_needy_here(const struct context *c) { return c->waiter_is_needy_here; }
static bool has_errand(const struct context *c) { return c->pending != NO_ERRAND; }
static bool is_to_hurry(const struct context *c) { return c->pending == TO_HURRY; }
static bool exchange_is_over(const struct context *c) { return c->exchange_is_over; }
static bool was_sent_home(const struct context *c) { return c->sent_home; }
static bool has_enough(const struct context *c) { return c->gives_up; }
static bool is_back(const struct context *c) { return c->is_home; }
static bool is_in_the_mood(const struct context *c) { return c->is_happy && c->has_joke; }

/* The behavior state generator. Rows are read from the top; one that applies acts, and goes or reads on. */
static const struct behavior_row BEHAVIOR_TABLE[] = {
    /* from                            when                  act            then */
    {IN(WAIT) | IN(REFILL),            waiter_is_needy_here, FINISH_ERRAND, EXCHANGE},
    {IN(WAIT),                         has_errand,           TAKE_ERRAND,   REFILL},
    {IN(REFILL),                       is_to_hurry,          HURRY,         STAY},
    {IN(EXCHANGE),                     exchange_is_over,     NOTHING,       AWAIT_GO_HOME},
    {IN(AWAIT_GO_HOME),                was_sent_home,        TURN_HOME,     GO_HOME},
    {IN(AWAIT_GO_HOME) | IN(REFILL),   has_enough,           GIVE_UP,       GO_HOME},
    {IN(GO_HOME),                      is_back,              NOTHING,       WAIT},
    {IN(WAIT) | IN(GO_HOME),           is_in_the_mood,       JOKE,          STAY},
};

static const char *const JOKES[] = {
    "Waiting is easy. I have it in my state table.",
    "I asked the table for a joke. It said the spread was good enough.",
    "My favorite distance is four feet.",
    "They say a watched pot never boils. Nobody has tried it with a watched robot.",
};

/* What she did before counts no more. */
static void begin_way(void)
{
    her.way = (struct closing){0};
}

static void joke(void)
{
    static struct text said;
    const char *chosen = JOKES[one_of(&her.jokes, COUNT(JOKES))];
    set_text(&said, "jokes: ");
    append(&said, chosen, strlen(chosen));
    say(said.bytes, said.length);
    her.until_joke_s = exponential(&her.jokes, told.parameters.joke_mean_s);
}

static void perform(enum act act)
{
    switch (act) {
    case NOTHING:
        break;
    case TAKE_ERRAND: /* sets out on what she was told */
        her.hurried = her.pending == TO_HURRY;
        her.pending = NO_ERRAND;
        break;
    case HURRY: /* from now on */
        her.hurried = true;
        her.pending = NO_ERRAND;
        break;
    case FINISH_ERRAND: /* what she was told before the exchange is done with */
        her.hurried = her.sent_home = false;
        her.pending = NO_ERRAND;
        break;
    case GIVE_UP: /* turns back */
        her.given_up += 1;
        her.hurried = false;
        begin_way();
        break;
    case TURN_HOME: /* counts the trip and obeys "go home" */
        her.trips += 1;
        her.sent_home = false;
        break;
    case JOKE:
        joke();
        break;
    }
}

/* Whether she is back at the table: at her place, or near it if somebody stands there and does not go. */
static bool is_home(void)
{
    double away_m = distance_m(her.at, her.home);
    bool is_kept_away = her.way.stalled_s >= told.parameters.settle_s;
    return away_m <= told.parameters.arrive_m || (away_m <= told.parameters.settle_m && is_kept_away);
}

/* Whether she turns back, by her policy. Where what she feels has no say, nothing makes her. */
static bool gives_up(void)
{
    bool acts_by_emotion = told.parameters.affect && told.parameters.schematic;
    switch (told.parameters.policy) {
    case BY_EMOTION:
        return acts_by_emotion && her.emotion == FRUSTRATED;
    case BY_RULES:
    case BY_TIMER:
        return her.measures.blocked >= 1.0 || her.measures.waiting >= 1.0;
    default:
        return false;
    }
}

static void update_behavior(void)
{
    struct context context = {
        .gives_up = gives_up(),
        .is_happy = told.parameters.affect && told.parameters.schematic && her.emotion == HAPPY,
        .pending = her.pending,
        .waiter_is_needy_here = is_needed() && is_waiter_here(),
        .exchange_is_over = has_lasted(told.parameters.exchange_s),
        .sent_home = her.sent_home,
        .is_home = is_home(),
        .has_joke = her.until_joke_s <= 0.0,
    };
    enum behavior from = her.behavior;
    for (size_t i = 0; i < COUNT(BEHAVIOR_TABLE); i++) {
        const struct behavior_row *row = &BEHAVIOR_TABLE[i];
        if (!(row->from & IN(from)) || !row->when(&context)) {
            continue;
        }
        perform(row->act);
        if (row->then != STAY) {
            her.behavior = row->then;
            her.lasting_s = 0.0;
            return;
        }
    }
}

/* ------------------------------------------------------------------------------------------------ a tick */

/* An unknown command as the log quotes it: at most 60 characters, what cannot be printed escaped. Beyond ASCII
 * everything is taken to be printable. */
static void wonder(const struct text *command, value from)
{
    enum { MAX_CHARACTERS = 60 };
    static struct text said, sender;
    char escape[16];
    int count = 0;
    set_text(&said, "does not understand \"");
    for (size_t i = 0; i < command->length; i++) {
        char c = command->bytes[i];
        bool begins_character = ((unsigned char)c & 0xc0) != 0x80;
        if (begins_character && ++count > MAX_CHARACTERS) {
            append(&said, "...", 3);
            break;
        }
        const char *known = c ? strchr("\tt\rr\nn\"\"\\\\", c) : NULL;
        if (!c || known) {
            append(&said, (char[]){'\\', known ? known[1] : '0'}, 2);
        } else if ((unsigned char)c < 0x20 || c == 0x7f) {
            append(&said, escape, (size_t)snprintf(escape, sizeof escape, "\\u{%x}", (unsigned)c));
        } else {
            append(&said, &c, 1);
        }
    }
    append(&said, "\" from ", 7);
    read_text(from, &sender);
    append(&said, sender.bytes, sender.length);
    say(said.bytes, said.length);
}

static void take_command(value message)
{
    static struct text command;
    value given = member(message, "command");
    bool is_there = her.behavior == EXCHANGE || her.behavior == AWAIT_GO_HOME;
    if (is_text(given, "refill")) {
        /* What was meant to bring her about is over once she is there. */
        if (her.behavior != EXCHANGE && her.behavior != REFILL && her.pending == NO_ERRAND) {
            her.pending = TO_REFILL;
        }
    } else if (is_text(given, "hurry")) {
        if (her.behavior != EXCHANGE) {
            her.pending = TO_HURRY;
        }
    } else if (is_text(given, "go home")) {
        /* The waiter may be done with the exchange a tick before her. */
        her.sent_home = her.sent_home || is_there;
    } else if (read_text(given, &command)) {
        wonder(&command, member(message, "from"));
    } else {
        fail("a command without text");
    }
}

/* All that a tick's line says; it is gone as soon as a question is asked. */
static void take_news(void)
{
    if (!read_point(member(message(), "location"), &her.at)) {
        fail("a tick without a location");
    }
    news.is_blocked = is_true(member(message(), "blocked"));
    news.senses_waiter = false;
    struct walk sensed = walk_over(member(message(), "sensed"));
    while (!news.senses_waiter && next(&sensed)) {
        bool is_waiter = is_text(member(sensed.value, "name"), told.parameters.waiter.bytes);
        news.senses_waiter = is_waiter && read_point(member(sensed.value, "location"), &news.waiter);
    }
    struct walk commands = walk_over(member(message(), "commands"));
    while (next(&commands)) {
        take_command(commands.value);
    }
}

/* Where she is going, if anywhere. */
static const struct point *goal(void)
{
    bool knows_waiter = her.waiter.has_place && !her.waiter.is_missing;
    return her.behavior == GO_HOME ? &her.home : her.behavior == REFILL && knows_waiter ? &her.waiter.place : NULL;
}

/* A tick goes by in what she is doing. */
static void advance(void)
{
    double tick_s = told.tick_s;
    her.lasting_s += tick_s;
    her.until_joke_s -= tick_s;
    her.waiting_s = her.behavior == AWAIT_GO_HOME ? her.waiting_s + tick_s : 0.0;
}

/* Whether she is nearer to her goal than ever before on this way. To and fro is no progress, neither is a search. */
static void watch_way(void)
{
    const struct point *to = goal();
    struct closing *way = &her.way;
    bool has_left = her.behavior == REFILL && has_lasted(told.parameters.prep_s);
    if (!has_left && her.behavior != GO_HOME) {
        begin_way();
        return;
    }
    way->stalled_s += told.tick_s;
    if (!to) {
        return;
    }
    double away_m = distance_m(her.at, *to);
    if (!way->has_nearest || away_m <= way->nearest_m - told.parameters.progress_m) {
        way->has_nearest = true;
        way->nearest_m = away_m;
        way->stalled_s = 0.0;
    }
}

static void update_measures(void)
{
    const struct parameters *parameters = &told.parameters;
    /* How strongly she reacts: 1 with the defaults. */
    double gain = parameters->caution_gain_base + parameters->caution_gain_slope * parameters->caution;
    her.measures = (struct measures){
        .hurried = her.hurried,
        .hurry = her.hurried ? parameters->hurry * gain : 0.0,
        .blocked = her.behavior == REFILL ? her.way.stalled_s * gain / parameters->block_patience_s : 0.0,
        .waiting = her.waiting_s * gain / parameters->await_patience_s,
        .th_concerned = parameters->th_concerned,
    };
}

/* On the way to the waiter; if he is not where he was last known to be, in search of him. */
static struct point refill(void)
{
    double speed_mps = told.parameters.v_refill_mps * haste();
    if (!has_lasted(told.parameters.prep_s)) {
        return stay();
    }
    const struct point *waiter = goal();
    return waiter ? drive(*waiter, told.parameters.stand_off_m, speed_mps) : walk_about(speed_mps);
}

static struct point project_location(void)
{
    switch (her.behavior) {
    case REFILL:
        return refill();
    case GO_HOME:
        return drive(her.home, 0.0, told.parameters.v_refill_mps);
    default:
        return stay();
    }
}

/* The words for who is responsible; `self` for her. */
static void put_agency(const char *self)
{
    const struct text *waiter = &told.parameters.waiter;
    switch (her.appraisal.agency) {
    case THE_WAITER:
        put_piece(waiter->bytes, waiter->length);
        break;
    case THE_CROWD:
        put("the crowd");
        break;
    default:
        put("%s", self);
        break;
    }
}

/* What she feels and why; nothing without emotions. */
static void put_affect(void)
{
    if (!told.parameters.affect) {
        return;
    }
    put(",\"valence\":");
    put_number(valence());
    put(",\"intensity\":");
    put_number(intensity());
    put(",\"urgency\":");
    put_number(her.urgency);
    put(",\"goal_congruence\":");
    put_number(her.appraisal.goal_congruence);
    put(",\"controllability\":");
    put_number(her.appraisal.controllability);
    put(",\"certainty\":");
    put_number(her.appraisal.certainty);
    put(",\"agency\":\"");
    put_agency("self");
    put("\",\"action_tendency\":\"%s\",\"face\":\"%s\"", FEELINGS[her.emotion].tendency,
        FEELINGS[her.emotion].face);
}

static void put_variables(void)
{
    const struct point *to = goal();
    put("{\"hurried\":");
    put_flag(her.hurried);
    put(",\"blocked_s\":");
    put_number(her.way.stalled_s);
    put(",\"waiting_s\":");
    put_number(her.waiting_s);
    put(",\"distance_m\":");
    put_number(to ? distance_m(her.at, *to) : 0.0);
    put(",\"pending\":\"%s\",\"trips\":%lu,\"given_up\":%lu,\"waiter\":", ERRAND_NAMES[her.pending],
        (unsigned long)her.trips, (unsigned long)her.given_up);
    put_bytes(told.parameters.waiter.bytes, told.parameters.waiter.length);
    put(",\"behavior\":\"%s\",\"home_x_m\":", BEHAVIOR_NAMES[her.behavior]);
    put_number(her.home.x_m);
    put(",\"home_y_m\":");
    put_number(her.home.y_m);
    put_affect();
    putchar('}');
}

/* The end of every tick: where to go next, and what to show. */
static void finish_tick(void)
{
    struct point there = project_location();
    put("{\"type\":\"done\",\"proposal\":{\"x\":");
    put_number(there.x_m);
    put(",\"y\":");
    put_number(there.y_m);
    put("},\"speed_mps\":");
    put_number(her.legs.speed_mps);
    put(",\"direction_rad\":");
    put_number(direction_rad());
    put(",\"emotion_state\":\"%s\",\"behavior_state\":\"%s\",\"state_variables\":", emotion_name(),
        BEHAVIOR_NAMES[her.behavior]);
    put_variables();
    put("}\n");
    flush();
}

/* ------------------------------------------------------------------------------------------------ what people see */

static const char *intensity_label(void)
{
    static const char *const LABELS[] = {"very low", "low", "medium", "high", "very high"};
    size_t reached = 0;
    for (size_t i = 0; i < COUNT(told.parameters.label_cuts); i++) {
        reached += intensity() >= told.parameters.label_cuts[i];
    }
    return LABELS[reached];
}

static void put_row(const char *name, const char *format, ...)
{
    char text[64];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    put("[");
    put_text(name);
    put(",");
    put_text(text);
    put("]");
}

/* Why she feels as she does, with her words filled in. */
static void put_account(const char *account)
{
    const struct text *waiter = &told.parameters.waiter, *goods = &told.parameters.goods;
    putchar('"');
    for (; *account; account++) {
        if (*account != '{') {
            put_piece(account, 1);
            continue;
        }
        if (account[1] == 'g') {
            put("to bring ");
            put_piece(goods->bytes, goods->length);
            put(" to ");
            put_piece(waiter->bytes, waiter->length);
        } else if (her.appraisal.agency == ONESELF) {
            put_piece(waiter->bytes, waiter->length);
        } else {
            put_agency("");
        }
        account += 2;
    }
    putchar('"');
}

/* What she feels: face, name, strength, account and appraisal. Without emotions a steady face and no name. */
static void put_feeling(void)
{
    const struct appraisal *appraisal = &her.appraisal;
    if (!told.parameters.affect) {
        put("{\"widget\":\"face\",\"face\":\"neutral\",\"intensity\":0}");
        put(",{\"widget\":\"badge\",\"label\":\"emotion\",\"text\":\"%s\",\"tone\":\"neutral\"}", emotion_name());
        return;
    }
    put("{\"widget\":\"face\",\"face\":\"%s\",\"intensity\":", FEELINGS[her.emotion].face);
    put_number(intensity());
    put("},{\"widget\":\"badge\",\"label\":\"emotion\",\"text\":\"%s\",\"tone\":\"%s\"}", emotion_name(),
        FEELINGS[her.emotion].tone);
    put(",{\"widget\":\"bar\",\"label\":\"intensity (%s)\",\"min\":0,\"max\":1,\"value\":", intensity_label());
    put_number(intensity());
    put("},{\"widget\":\"text\",\"label\":\"why\",\"text\":");
    put_account(FEELINGS[her.emotion].account);
    put("},{\"widget\":\"table\",\"rows\":[");
    put_row("goal congruence", "%.2f", appraisal->goal_congruence);
    put(",");
    put_row("controllability", "%.2f", appraisal->controllability);
    put(",");
    put_row("certainty", "%.2f", appraisal->certainty);
    put(",[\"agency\",\"");
    put_agency("self");
    put("\"]]}");
}

static void put_panel(void)
{
    const struct point *to = goal();
    put("{\"type\":\"panel\",\"widgets\":[");
    put_feeling();
    put(",{\"widget\":\"badge\",\"label\":\"behavior\",\"text\":\"%s\",\"tone\":\"neutral\"}",
        BEHAVIOR_NAMES[her.behavior]);
    put(",{\"widget\":\"table\",\"rows\":[[\"waiter\",");
    put_bytes(told.parameters.waiter.bytes, told.parameters.waiter.length);
    put("],");
    put_row("way to go", to ? "%.1f m" : "-", to ? distance_m(her.at, *to) : 0.0);
    put(",");
    put_row("hurried", "%s", her.hurried ? "yes" : "no");
    put(",");
    put_row("blocked for", "%.1f s", her.way.stalled_s);
    put(",");
    put_row("kept waiting for", "%.1f s", her.waiting_s);
    put(",");
    put_row("trips, given up", "%lu, %lu", (unsigned long)her.trips, (unsigned long)her.given_up);
    put("]}");
    static const char *const BUTTONS[] = {"refill", "hurry", "go home"};
    for (size_t i = 0; i < COUNT(BUTTONS); i++) {
        put(",{\"widget\":\"button\",\"label\":\"%s\",\"command\":\"%s\"}", BUTTONS[i], BUTTONS[i]);
    }
    put("]}\n");
}

/* ------------------------------------------------------------------------------------------------ her life */

static uint64_t read_seed(value init)
{
    double seed;
    if (!read_number(member(init, "seed"), &seed) || seed < 0.0 || seed >= 9007199254740992.0) {
        fail("the seed is no number from 0 to 2^53 - 1");
    }
    return (uint64_t)seed;
}

static void read_told(value init)
{
    struct walk field = walk_over(member(init, "field_m"));
    bool is_told = read_text(member(init, "name"), &told.name) && read_number(member(init, "tick_s"), &told.tick_s) &&
                   next(&field) && read_number(field.value, &told.width_m) && next(&field) &&
                   read_number(field.value, &told.height_m) && read_number(member(init, "body_m"), &told.body_m) &&
                   read_number(member(init, "sensing_range_m"), &told.sensing_range_m);
    if (!is_told) {
        fail("init lacks one of name, tick_s, field_m, body_m, sensing_range_m");
    }
    if (!(told.tick_s > 0.0)) {
        fail("a tick of %g s", told.tick_s);
    }
    read_parameters(&told.parameters, member(init, "parameters"));
}

static uint32_t counted(value number)
{
    double count;
    return read_number(number, &count) && count > 0.0 ? (uint32_t)least(count, UINT32_MAX) : 0;
}

/* A former incarnation of her was lost: what it knew, and what it did. */
static void take_over(value last)
{
    value pending = member(last, "pending"), behavior = member(last, "behavior");
    her.hurried = is_true(member(last, "hurried"));
    her.pending = is_text(pending, "refill") ? TO_REFILL : is_text(pending, "hurry") ? TO_HURRY : NO_ERRAND;
    her.trips = counted(member(last, "trips"));
    her.given_up = counted(member(last, "given_up"));
    struct point home;
    if (read_number(member(last, "home_x_m"), &home.x_m) && read_number(member(last, "home_y_m"), &home.y_m)) {
        her.home = home;
    }
    her.behavior = GO_HOME;
    for (int known = 0; known < BEHAVIORS; known++) {
        if (is_text(behavior, BEHAVIOR_NAMES[known])) {
            her.behavior = (enum behavior)known;
        }
    }
    static const char BACK[] = "is back, and takes over where the last one was lost";
    say(BACK, sizeof BACK - 1);
}

/* Back to the initial state. Home is where she starts; each thing that she leaves to chance has a stream of its own. */
static void begin(void)
{
    static struct text stream_name;
    value init = message();
    read_told(init);
    memset(&her, 0, sizeof her);
    her.legs.heading.x = 1.0;
    her.legs.side = 1.0;
    /* Nothing is in her way yet, and nothing is certain. */
    her.appraisal = (struct appraisal){.goal_congruence = 1.0, .controllability = 1.0};
    if (!read_point(member(init, "location"), &her.at) || !read_text(member(init, "stream"), &stream_name)) {
        fail("init lacks location or stream");
    }
    her.home = her.at;
    struct stream own = named(read_seed(init), stream_name.bytes);
    her.turns = seeded(draw(&own));
    her.jokes = seeded(draw(&own));
    her.until_joke_s = exponential(&her.jokes, told.parameters.joke_mean_s);
    value last = member(init, "last_state_variables");
    double tick;
    if (!read_number(member(init, "tick"), &tick)) {
        fail("init lacks its tick");
    }
    if (tick == 0.0) {
        news.is_blocked = false;
        put_panel();
        finish_tick();
    } else if (last) {
        take_over(last);
    }
}

/* One tick, in the order of the paper's Figure 5. */
static void tick(void)
{
    /* A panel is for eyes: when something has changed that is seen at a glance, else every fifth second. */
    static double unpainted_s;
    enum emotion felt = her.emotion;
    enum behavior did = her.behavior;
    take_news();
    advance();
    watch_waiter();
    watch_way();
    update_measures();
    update_emotion();
    update_behavior();
    unpainted_s += told.tick_s;
    if (felt != her.emotion || did != her.behavior || unpainted_s >= 5.0) {
        unpainted_s = 0.0;
        put_panel();
    }
    finish_tick();
}

int main(void)
{
    bool has_begun = false;
    while (read_line() && !is_type("end")) {
        if (is_type("init")) {
            begin();
            has_begun = true;
        } else if (is_type("tick") && has_begun) {
            tick();
        } else {
            fail("neither init nor tick nor end: %.80s", line);
        }
    }
    return EXIT_SUCCESS;
}
