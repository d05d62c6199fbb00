/* @NAME@ strolls back and forth. When it has been blocked for too long, it becomes frustrated and turns around.
 *
 * `cars exec` speaks the simulator's protocol for it: one JSON object a line arrives on standard input,
 * and the answers go to standard output. What it writes to standard error is shown by the launcher,
 * and kept in the log of its process.
 *
 * No library but the standard one is needed. Lines are searched for what stands in front of a value:
 * `type` is their first field, and a quotation mark inside a text has a backslash before it, so "x":
 * can only be a field.
 */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Its state: init sets everything. Meters, seconds. */
static struct {
    double tick_s;
    double walk_m, speed_mps, patience_s; /* [robot.params] of the scenario, in SI units */
    double x, y;
    double from_x, to_x; /* the ends of its stroll; it is on its way to the second */
    double held_up_s;    /* its measure of progress: how long it has been blocked */
    int turns;
    bool is_frustrated, is_resting;
} robot;

/* The number that stands behind `field`, or 0. */
static double number(const char *line, const char *field) {
    const char *at = strstr(line, field);
    return at ? strtod(at + strlen(field), NULL) : 0;
}

/* The length of a text from here to its closing quotation mark, as JSON has it. */
static int length(const char *text) {
    int at = 0;
    while (text[at] && text[at] != '"') at += text[at] == '\\' && text[at + 1] ? 2 : 1;
    return at;
}

/* Where it stands now: the place it proposed, or its old one if that was taken. */
static void stand(const char *line) {
    const char *location = strstr(line, "\"location\":{");
    if (!location) return;
    robot.x = number(location, "\"x\":");
    robot.y = number(location, "\"y\":");
}

/* Before tick 0, and whenever the run starts again: back to the initial state. */
static void init(const char *line) {
    memset(&robot, 0, sizeof robot);
    stand(line);
    robot.tick_s = number(line, "\"tick_s\":");
    robot.walk_m = number(line, "\"walk_m\":");
    robot.speed_mps = number(line, "\"speed_mps\":");
    robot.patience_s = number(line, "\"patience_s\":");
    robot.from_x = robot.x;
    robot.to_x = robot.x + robot.walk_m;
    /* Its panel in the console: two buttons that send it commands. */
    puts("{\"type\":\"panel\",\"widgets\":["
         "{\"widget\":\"button\",\"label\":\"Rest\",\"command\":\"rest\"},"
         "{\"widget\":\"button\",\"label\":\"Stroll\",\"command\":\"stroll\"}]}");
}

static void turn(void) {
    double end = robot.from_x;
    robot.from_x = robot.to_x;
    robot.to_x = end;
    robot.turns++;
}

/* Obeys the commands of the line, one after the other. */
static void obey(const char *line) {
    const char *const from = "\"from\":\"";
    const char *const what = "\",\"performative\":\"achieve\",\"command\":\"";
    while ((line = strstr(line, from))) {
        const char *sender = line + strlen(from), *command = sender + length(sender);
        line = sender;
        /* In a payload, the fields of an object are in the order of their names. */
        if (strncmp(command, what, strlen(what))) continue;
        command += strlen(what);
        int size = length(command);
        line = command + size;
        bool rests = size == 4 && !strncmp(command, "rest", 4);
        bool strolls = size == 6 && !strncmp(command, "stroll", 6);
        /* The texts are JSON already. */
        if (rests || strolls) {
            robot.is_resting = rests;
            printf("{\"type\":\"log\",\"text\":\"obeys %.*s: %.*s\"}\n",
                   length(sender), sender, size, command);
        } else {
            printf("{\"type\":\"log\",\"text\":\"does not know how to %.*s\"}\n",
                   size, command);
        }
    }
}

/* One tick: from what it perceives to what it does. */
static void tick(const char *line) {
    stand(line);
    obey(line);

    /* Progress, in what stands before the commands: a payload may have any field. */
    const char *blocked = strstr(line, "\"blocked\":true"), *commands = strstr(line, "\"commands\":");
    if (blocked && (!commands || blocked < commands))
        robot.held_up_s += robot.tick_s;
    else
        robot.held_up_s = fmax(robot.held_up_s - robot.tick_s / 2, 0);

    /* The emotion state generator: progress in, emotion out. */
    bool was_frustrated = robot.is_frustrated;
    robot.is_frustrated = was_frustrated ? robot.held_up_s > 0 : robot.held_up_s >= robot.patience_s;

    /* The behavior state generator: emotion in, behavior out. */
    if (robot.is_frustrated && !was_frustrated) turn();
    if (robot.x == robot.to_x) turn();
}

/* The end of every tick: where it wants to stand at the next one, and what other robots can query. 17
 * digits are the whole number, to the last bit. */
static void done(void) {
    double speed_mps = robot.is_resting ? 0 : robot.speed_mps;
    double step = speed_mps * robot.tick_s, left = robot.to_x - robot.x;
    double x = fabs(left) <= step ? robot.to_x : robot.x + copysign(step, left);
    printf("{\"type\":\"done\",\"proposal\":{\"x\":%.17g,\"y\":%.17g},"
           "\"speed_mps\":%.17g,\"direction_rad\":%s,"
           "\"emotion_state\":\"%s\",\"behavior_state\":\"%s\","
           "\"state_variables\":{\"held_up_s\":%.17g,\"turns\":%d}}\n",
           robot.is_resting ? robot.x : x, robot.y, speed_mps, left < 0 ? "3.141593" : "0",
           robot.is_frustrated ? "FRUSTRATED" : "HAPPY", robot.is_resting ? "REST" : "STROLL",
           robot.held_up_s, robot.turns);
}

static bool is(const char *line, const char *beginning) { return !strncmp(line, beginning, strlen(beginning)); }

int main(void) {
    char *line = NULL;
    size_t size = 0;
    while (getline(&line, &size, stdin) > 0 && !is(line, "{\"type\":\"end\"")) {
        bool is_init = is(line, "{\"type\":\"init\"");
        bool is_tick = is(line, "{\"type\":\"tick\"");
        if (is_init) init(line);
        if (is_tick) tick(line);
        /* An init in the middle of a run is not answered: the tick that follows at once is. */
        if (is_tick || (is_init && strstr(line, "\"tick\":0,"))) done();
        fflush(stdout); /* A pipe is not flushed at the end of a line by itself. */
    }
    free(line);
    return 0;
}
