/*
 * Walker, in C over cJSON (Debian, Ubuntu: libcjson-dev; Fedora: cjson-devel; Homebrew: cjson): walks to and fro, counts its
 * steps, and is annoyed when somebody is in its way. A run with it is, byte for byte, a run with the Walker in Python
 * (sdk/python/examples/walker.py).
 *
 *     cc -std=c11 -O2 -ffp-contract=off -o walker walker.c -lcjson
 *     cars exec --name Walker -- ./walker
 *
 * It speaks JSON Lines over stdin and stdout (docs/any-language.md). Units are SI.
 */
#define _POSIX_C_SOURCE 200809L
#include <cjson/cJSON.h>
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* a * b + c rounds twice, here as in every other language: fused into one operation it is another number in the last bit. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif
#if FLT_EVAL_METHOD < 0 || FLT_EVAL_METHOD == 2 || defined(__FAST_MATH__)
#error "doubles must be computed as doubles: compile for SSE2 (-msse2 -mfpmath=sse) and without -ffast-math"
#endif

/* What it is told when it joins, and what it remembers. */
static struct {
    double tick_s;
    double x_m, y_m;
    double way_mps;
    int steps;
    bool is_annoyed;
} walker;

static _Noreturn void fail(const char *reason)
{
    fprintf(stderr, "walker: %s\n", reason);
    exit(EXIT_FAILURE);
}

static bool is(const cJSON *text, const char *wanted)
{
    return cJSON_IsString(text) && strcmp(text->valuestring, wanted) == 0;
}

static const char *text(const cJSON *object, const char *name)
{
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, name);
    return cJSON_IsString(value) ? value->valuestring : "";
}

static double number(const cJSON *object, const char *name)
{
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, name);
    if (!cJSON_IsNumber(value) || !isfinite(value->valuedouble)) {
        fail("a number is missing");
    }
    return value->valuedouble;
}

/* cJSON writes a number with 15 digits where these are nearly right. 17 are right to the last bit. */
static void add_number(cJSON *object, const char *name, double value)
{
    char digits[32];
    snprintf(digits, sizeof digits, "%.17g", value);
    cJSON_AddRawToObject(object, name, digits);
}

/* Reads the next message; NULL at the end of the run. */
static cJSON *receive(void)
{
    static char *line;
    static size_t size;
    if (getline(&line, &size, stdin) < 0) {
        return NULL;
    }
    cJSON *message = cJSON_ParseWithOpts(line, NULL, true);
    if (!cJSON_IsObject(message)) {
        fail("a line is not a JSON object");
    }
    if (is(cJSON_GetObjectItemCaseSensitive(message, "type"), "end")) {
        cJSON_Delete(message);
        return NULL;
    }
    return message;
}

/* Writes a message as a line. */
static void send(cJSON *message)
{
    char *line = cJSON_PrintUnformatted(message);
    if (!line || printf("%s\n", line) < 0 || fflush(stdout) != 0) {
        fail("cannot write to stdout");
    }
    cJSON_free(line);
    cJSON_Delete(message);
}

static cJSON *message_of(const char *type)
{
    cJSON *message = cJSON_CreateObject();
    cJSON_AddStringToObject(message, "type", type);
    return message;
}

static void log_command(const cJSON *command)
{
    char line[4200];
    const char *from = text(command, "from"), *said = text(command, "command");
    snprintf(line, sizeof line, "does not know what %s means by '%s'", from, said);
    cJSON *message = message_of("log");
    cJSON_AddStringToObject(message, "text", line);
    send(message);
}

static void take_location(const cJSON *message)
{
    const cJSON *location = cJSON_GetObjectItemCaseSensitive(message, "location");
    walker.x_m = number(location, "x");
    walker.y_m = number(location, "y");
}

/* The end of every tick: where it goes next, and what others see of it. */
static void finish_tick(void)
{
    cJSON *done = message_of("done");
    cJSON *proposal = cJSON_AddObjectToObject(done, "proposal");
    add_number(proposal, "x", walker.x_m + walker.way_mps * walker.tick_s);
    add_number(proposal, "y", walker.y_m);
    add_number(done, "speed_mps", fabs(walker.way_mps));
    add_number(done, "direction_rad", walker.way_mps > 0.0 ? 0.0 : 3.141593);
    cJSON_AddStringToObject(done, "emotion_state", walker.is_annoyed ? "ANNOYED" : "CALM");
    cJSON_AddStringToObject(done, "behavior_state", "WALK");
    cJSON *variables = cJSON_AddObjectToObject(done, "state_variables");
    add_number(variables, "steps", walker.steps);
    send(done);
}

/* Begins from the initial state. The process that replaces a lost one answers the tick that follows instead of this message. */
static void init(const cJSON *message)
{
    walker.tick_s = number(message, "tick_s");
    walker.way_mps = 0.5;
    walker.steps = 0;
    walker.is_annoyed = false;
    take_location(message);
    if (number(message, "tick") == 0.0) {
        finish_tick();
    }
}

static void tick(const cJSON *message)
{
    const cJSON *command;
    take_location(message);
    cJSON_ArrayForEach(command, cJSON_GetObjectItemCaseSensitive(message, "commands")) {
        log_command(command);
    }

    walker.is_annoyed = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(message, "blocked"));
    if (walker.is_annoyed) {
        walker.way_mps = -walker.way_mps;
    } else {
        walker.steps += 1;
    }
    finish_tick();
}

int main(void)
{
    for (cJSON *message = receive(); message; message = receive()) {
        const cJSON *type = cJSON_GetObjectItemCaseSensitive(message, "type");
        if (is(type, "init")) {
            init(message);
        } else if (is(type, "tick")) {
            tick(message);
        } else {
            fail("neither init nor tick nor end");
        }
        cJSON_Delete(message);
    }
    return EXIT_SUCCESS;
}
