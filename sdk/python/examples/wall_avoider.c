/* A node of ROS 2 in C that keeps away from walls, and answers each tick with a velocity that has the stamp of the tick.
 *
 * It knows nothing of CARS: it subscribes to /clock and to its scan, and publishes cmd_vel. Beside an adapter it is a robot:
 *
 *     python -m cars.ros --external --answer stamp --name Rosie
 *     wall_avoider --ros-args -r __ns:=/Rosie
 *
 * docs/ros.md has how it is compiled.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "geometry_msgs/msg/twist_stamped.h"
#include "rcl/error_handling.h"
#include "rcl/rcl.h"
#include "rosgraph_msgs/msg/clock.h"
#include "sensor_msgs/msg/laser_scan.h"

static const double SPEED_MPS = 0.2;
static const double TURN_RADPS = 1.5;
/* Nearer than this, it turns where it stands. */
static const double NEAR_M = 0.7;
/* How far to the left and to the right it looks for what is in its way. */
static const double AHEAD_RAD = 0.6;

static void check(rcl_ret_t status, const char *what) {
    if (status != RCL_RET_OK) {
        fprintf(stderr, "wall_avoider: %s: %s\n", what, rcl_get_error_string().str);
        exit(1);
    }
}

/* Whether two messages are of the same tick. */
static int is_same_time(const builtin_interfaces__msg__Time *one, const builtin_interfaces__msg__Time *other) {
    return one->sec == other->sec && one->nanosec == other->nanosec;
}

/* The shortest ray ahead. A range that is infinite has met nothing. */
static double nearest_m(const sensor_msgs__msg__LaserScan *scan) {
    double nearest = INFINITY;
    for (size_t ray = 0; ray < scan->ranges.size; ray++) {
        double angle_rad = scan->angle_min + (double)ray * scan->angle_increment;
        if (fabs(remainder(angle_rad, 2.0 * M_PI)) <= AHEAD_RAD && scan->ranges.data[ray] < nearest) {
            nearest = scan->ranges.data[ray];
        }
    }
    return nearest;
}

/* Takes what has arrived, and returns whether anything has. */
static int take(const rcl_subscription_t *subscription, void *message) {
    rcl_ret_t status = rcl_take(subscription, message, NULL, NULL);
    if (status == RCL_RET_SUBSCRIPTION_TAKE_FAILED) {
        rcl_reset_error();
        return 0;
    }
    check(status, "a message cannot be taken");
    return 1;
}

int main(int argc, const char *const *argv) {
    rcl_allocator_t allocator = rcl_get_default_allocator();
    rcl_init_options_t init_options = rcl_get_zero_initialized_init_options();
    check(rcl_init_options_init(&init_options, allocator), "options");
    rcl_context_t context = rcl_get_zero_initialized_context();
    check(rcl_init(argc, argv, &init_options, &context), "ROS cannot be started");
    rcl_node_t node = rcl_get_zero_initialized_node();
    rcl_node_options_t node_options = rcl_node_get_default_options();
    check(rcl_node_init(&node, "wall_avoider", "", &context, &node_options), "the node cannot be made");

    rcl_subscription_options_t options = rcl_subscription_get_default_options();
    rcl_subscription_t clocks = rcl_get_zero_initialized_subscription();
    const rosidl_message_type_support_t *clock_type = ROSIDL_GET_MSG_TYPE_SUPPORT(rosgraph_msgs, msg, Clock);
    check(rcl_subscription_init(&clocks, &node, clock_type, "/clock", &options), "/clock");
    rcl_subscription_t scans = rcl_get_zero_initialized_subscription();
    const rosidl_message_type_support_t *scan_type = ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, LaserScan);
    check(rcl_subscription_init(&scans, &node, scan_type, "scan", &options), "scan");
    rcl_publisher_options_t publisher_options = rcl_publisher_get_default_options();
    rcl_publisher_t velocities = rcl_get_zero_initialized_publisher();
    const rosidl_message_type_support_t *velocity_type = ROSIDL_GET_MSG_TYPE_SUPPORT(geometry_msgs, msg, TwistStamped);
    check(rcl_publisher_init(&velocities, &node, velocity_type, "cmd_vel", &publisher_options), "cmd_vel");

    rosgraph_msgs__msg__Clock clock;
    sensor_msgs__msg__LaserScan scan;
    geometry_msgs__msg__TwistStamped velocity;
    if (!rosgraph_msgs__msg__Clock__init(&clock) || !sensor_msgs__msg__LaserScan__init(&scan) ||
        !geometry_msgs__msg__TwistStamped__init(&velocity)) {
        fprintf(stderr, "wall_avoider: out of memory\n");
        return 1;
    }

    rcl_wait_set_t waiting = rcl_get_zero_initialized_wait_set();
    check(rcl_wait_set_init(&waiting, 2, 0, 0, 0, 0, 0, &context, allocator), "the wait set cannot be made");
    int has_clock = 0;
    int has_scan = 0;
    for (;;) {
        check(rcl_wait_set_clear(&waiting), "the wait set cannot be cleared");
        check(rcl_wait_set_add_subscription(&waiting, &clocks, NULL), "/clock");
        check(rcl_wait_set_add_subscription(&waiting, &scans, NULL), "scan");
        check(rcl_wait(&waiting, -1), "it cannot wait");

        int has_news = 0;
        while (take(&clocks, &clock)) {
            has_clock = has_news = 1;
        }
        while (take(&scans, &scan)) {
            has_scan = has_news = 1;
        }
        /* The two topics are on their way by themselves, and either may be first: the tick is complete when both have its time.
         * A tick that is published again is answered again, and the same: nothing is remembered but the last of each. */
        if (!has_news || !has_clock || !has_scan || !is_same_time(&clock.clock, &scan.header.stamp)) {
            continue;
        }
        int is_near = nearest_m(&scan) < NEAR_M;
        velocity.header.stamp = clock.clock;
        velocity.twist.linear.x = is_near ? 0.0 : SPEED_MPS;
        velocity.twist.angular.z = is_near ? TURN_RADPS : 0.0;
        check(rcl_publish(&velocities, &velocity, NULL), "the velocity cannot be published");
    }
}
