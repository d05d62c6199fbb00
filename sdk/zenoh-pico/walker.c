/*
 * Walker, in C over zenoh-pico: walks to and fro, counts its steps, and is annoyed when somebody is in its way. A run with it is,
 * byte for byte, a run with the Walker in Python (sdk/python/examples/walker.py). docs/zenoh-pico.md says how to build it.
 */
#include "robot.h"

#include <math.h>

/* a * b + c rounds twice, here as in every other language: fused into one operation it is another number in the last bit. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif

static struct {
    double tick_s;
    double way_mps;
    int steps;
} walker;

void robot_init(const json_t *welcome)
{
    walker.tick_s = json_number_value(json_object_get(welcome, "tick_s"));
    walker.way_mps = 0.5;
    walker.steps = 0;
}

json_t *robot_tick(const Perceived *perceived, Point *proposal, json_t *log)
{
    size_t index;
    json_t *command;
    json_array_foreach(perceived->commands, index, command) {
        const char *from = json_string_value(json_object_get(command, "from"));
        const char *text = json_string_value(json_object_get(command, "command"));
        json_t *line = NULL;
        /* A line of the log has at most 4096 bytes, and ends with a whole character: one of four cuts leaves it whole. */
        for (int most = 3900; !line && most > 3896; most--) {
            line = json_sprintf("does not know what %s means by '%.*s'", from, most, text);
        }
        json_array_append_new(log, line);
    }

    if (perceived->blocked) walker.way_mps = -walker.way_mps;
    else if (perceived->tick > 0) walker.steps += 1;
    proposal->x += walker.way_mps * walker.tick_s;

    return json_pack("{s:f,s:f,s:s,s:s,s:{s:i}}",
        "speed_mps", fabs(walker.way_mps),
        "direction_rad", walker.way_mps > 0.0 ? 0.0 : 3.141593,
        "emotion_state", perceived->blocked ? "ANNOYED" : "CALM",
        "behavior_state", "WALK",
        "state_variables", "steps", walker.steps);
}
