#!/usr/bin/env bash
# A stroller in Bash alone, without jq, bc or awk: goes straight on, turns where the way is not free, and feels it when it
# gets nowhere. It nods to who says hello.
#
#     cars exec --name Bruno -- ./stroller.sh
#
# It speaks JSON Lines over stdin and stdout (docs/protocol.md, "Robots over stdin and stdout"). Bash has no fractions, so
# it counts in whole millimeters and milliseconds. Patterns read what it needs from a line: inside of JSON text every
# quotation mark is escaped, so that `"location":` can only be the name of a member, and the first one is its own.
set -uo pipefail
LC_ALL=C # a point is a decimal point, a character is a byte

readonly SPEED_MMPS=450         # how fast it goes
readonly PATIENCE_MS=6000       # time without progress that makes it GRUMPY
readonly SHARE_PERCENT=60       # of the last steps must have been refused for it to be no progress

# What it reads, as patterns.
readonly DECIMAL='^(-?)([0-9]{1,9})(\.([0-9]+))?$'
readonly LOCATION='"location":\{"x":([0-9.eE+-]+),"y":([0-9.eE+-]+)\}'
readonly VALUE='^\{"type":"answer","value":([0-9.eE+-]+)\}'
readonly TICK_S='"tick_s":([0-9.]+)'
readonly HELLO='"from":"([A-Za-z0-9_.-]+)","performative":"[^"]*","command":"hello"'

fail() { printf 'stroller: %s\n' "$*" >&2; exit 1; }

# Sets `thousandths` to a decimal number times 1000, rounded toward zero: 7.62 to 7620.
in_thousandths() {
    [[ $1 =~ $DECIMAL ]] || { thousandths=0; return; } # 1e-7 and its like
    local fraction=${BASH_REMATCH[4]}000
    thousandths=${BASH_REMATCH[1]}$((10#${BASH_REMATCH[2]} * 1000 + 10#${fraction:0:3}))
}

# Sets `decimal` to thousandths as a decimal number: -50 to -0.050.
as_decimal() {
    local number=$1 sign=''
    ((number < 0)) && sign=- number=$((-number))
    printf -v decimal '%s%d.%03d' "$sign" $((number / 1000)) $((number % 1000))
}

# Sets `x_mm` and `y_mm` to its own location.
read_location() {
    [[ $1 =~ $LOCATION ]] || fail "no location in: ${1:0:80}"
    local y=${BASH_REMATCH[2]}
    in_thousandths "${BASH_REMATCH[1]}"; x_mm=$thousandths
    in_thousandths "$y"; y_mm=$thousandths
}

# Sets `line` to what is told next; the end of the input is the end.
hear() { IFS= read -r line || exit 0; }

say() { printf '%s\n' "$1" || exit 1; }

# Sets `drawn` to a number from 0 to 999, by chance.
draw() {
    say '{"type":"random"}'
    hear
    [[ $line =~ $VALUE ]] || exit 0 # the end came first
    in_thousandths "${BASH_REMATCH[1]}"; drawn=$thousandths
}

# Eight headings, counter-clockwise from +x, in thousandths; 707 is the half of a square root of 2.
readonly HEADING_X=(1000 707 0 -707 -1000 -707 0 707)
readonly HEADING_Y=(0 707 1000 707 0 -707 -1000 -707)
readonly HEADING_RAD=(0 0.785398 1.570796 2.356194 3.141593 -2.356194 -1.570796 -0.785398)

begin() {
    [[ $1 =~ $TICK_S ]] || fail "no tick_s in: ${1:0:80}"
    in_thousandths "${BASH_REMATCH[1]}"; tick_ms=$thousandths
    heading=0 stuck_ms=0 refused=0 turns=0 greetings=0 emotion=CALM behavior=STROLL
}

# Nods to who says hello: one command after the other is cut off the line.
greet() {
    local rest=$1
    while [[ $rest =~ $HELLO ]]; do
        rest=${rest#*"${BASH_REMATCH[0]}"}
        greetings=$((greetings + 1))
        say "{\"type\":\"log\",\"text\":\"nods to ${BASH_REMATCH[1]}\"}"
    done
}

# Progress: `refused` is the share of its steps that were refused lately, in percent, newer ones counting for more.
update_state_variables() {
    refused=$(((refused * 3 + (is_blocked ? 100 : 0)) / 4))
    if ((refused >= SHARE_PERCENT)); then
        stuck_ms=$((stuck_ms + tick_ms))
    else
        stuck_ms=$((stuck_ms > 2 * tick_ms ? stuck_ms - 2 * tick_ms : 0))
    fi
}

# Emotion state generator: from progress.
update_emotion_state() {
    if ((stuck_ms >= PATIENCE_MS)); then
        emotion=GRUMPY
    elif ((stuck_ms >= PATIENCE_MS / 3)); then
        emotion=UNEASY
    elif ((stuck_ms == 0)); then
        emotion=CALM
    fi
}

# Behavior state generator: from emotion and progress. Who is grumpy waits until the others are gone.
update_behavior_state() {
    case $behavior:$emotion in
        STROLL:GRUMPY) behavior=SULK ;;
        SULK:CALM) behavior=STROLL ;;
    esac
}

# Sets `next_x_mm` and `next_y_mm` to where it wants to be.
project_location() {
    local step_mm=$((SPEED_MMPS * tick_ms / 1000))
    speed_mmps=$SPEED_MMPS
    if [[ $behavior == SULK ]]; then
        step_mm=0 speed_mmps=0 refused=0
    elif ((is_blocked)); then
        # To the left or to the right, by 45 to 135 degrees.
        draw
        heading=$(((heading + (drawn < 500 ? 1 : 5) + drawn % 3) % 8))
        turns=$((turns + 1))
    fi
    next_x_mm=$((x_mm + HEADING_X[heading] * step_mm / 1000))
    next_y_mm=$((y_mm + HEADING_Y[heading] * step_mm / 1000))
}

finish() {
    local x y speed stuck face=neutral tone=neutral
    project_location
    as_decimal "$next_x_mm"; x=$decimal
    as_decimal "$next_y_mm"; y=$decimal
    as_decimal "$speed_mmps"; speed=$decimal
    as_decimal "$stuck_ms"; stuck=$decimal
    case $emotion in
        CALM) face=happy tone=good ;;
        GRUMPY) face=angry tone=bad ;;
    esac
    say "{\"type\":\"panel\",\"widgets\":[{\"widget\":\"face\",\"face\":\"$face\",\"intensity\":0.8},\
{\"widget\":\"badge\",\"label\":\"emotion\",\"text\":\"$emotion\",\"tone\":\"$tone\"},\
{\"widget\":\"badge\",\"label\":\"behavior\",\"text\":\"$behavior\",\"tone\":\"neutral\"}]}"
    say "{\"type\":\"done\",\"proposal\":{\"x\":$x,\"y\":$y},\"speed_mps\":$speed,\
\"direction_rad\":${HEADING_RAD[heading]},\"emotion_state\":\"$emotion\",\"behavior_state\":\"$behavior\",\
\"state_variables\":{\"stuck_s\":$stuck,\"turns\":$turns,\"greetings\":$greetings}}"
}

while hear; do
    is_blocked=0
    case $line in
        '{"type":"end"'*) exit 0 ;;
        '{"type":"init"'*)
            begin "$line"
            read_location "$line"
            [[ $line == *'"tick":0,'* ]] || continue # it takes over, and answers the tick that follows
            ;;
        '{"type":"tick"'*)
            # In what stands before the commands: a payload may have any field.
            [[ ${line%%'"commands":'*} == *'"blocked":true'* ]] && is_blocked=1
            read_location "$line"
            greet "$line"
            update_state_variables
            update_emotion_state
            update_behavior_state
            ;;
        *) fail "neither init nor tick nor end: ${line:0:80}" ;;
    esac
    finish
done
