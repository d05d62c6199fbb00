/*
 * A robot over zenoh-pico. `robot.c` speaks the protocol (docs/protocol.md) and is the same for every robot; what a robot is,
 * `walker.c` or yours, are these two functions. Both run on the main thread. Units are SI.
 */
#pragma once
#include <jansson.h>
#include <stdbool.h>

typedef struct { double x, y; } Point;

/* What is new in a tick. `location` is where the robot stands; `commands` has objects with `from`, `command` and maybe `payload`. */
typedef struct {
    json_int_t tick;
    Point location;
    bool blocked;
    const json_t *commands;
} Perceived;

/* Begins from the initial state: before tick 0 of each epoch, and where this process takes over from another one. */
void robot_init(const json_t *welcome);

/*
 * One tick. Sets where the robot wants to be at the next one, which is its location at first, and may append texts to the `log` of
 * the run. Returns what others may know, a new object: `speed_mps`, `direction_rad`, `emotion_state`, `behavior_state` and
 * `state_variables`. The same ticks must give the same results: neither clocks nor other chance than the stream of the welcome.
 */
json_t *robot_tick(const Perceived *perceived, Point *proposal, json_t *log);
