#!/usr/bin/env bash
# @NAME@ strolls back and forth. When it has been blocked for too long, it becomes frustrated and turns around.
#
# `cars exec` speaks the simulator's protocol for it: one JSON object a line arrives on standard input,
# and the answers go to standard output. What it writes to standard error is shown by the launcher,
# and kept in the log of its process.
#
# No program but Bash is needed. Lines are searched with regular expressions: `type` is their first
# field, and a quotation mark inside a text has a backslash before it, so "x": can only be a field.
# Bash counts in whole numbers only, so this robot counts in millionths: micrometers, microseconds.
set -u
LC_ALL=C

say() { printf '%s\n' "$1"; }

# Puts the number in field $1 of the line into REPLY, in millionths: 4.572 is 4572000.
millionths() {
    REPLY=0
    # A number with a negative exponent is less than a millionth or near it.
    [[ $line =~ \"$1\":(-?)([0-9]+)(\.([0-9]+))?(e-)? && -z ${BASH_REMATCH[5]} ]] || return 0
    local fraction=${BASH_REMATCH[4]}000000
    REPLY=$((${BASH_REMATCH[1]}(10#${BASH_REMATCH[2]} * 1000000 + 10#${fraction:0:6})))
}

# Puts a number of millionths into REPLY as JSON has it.
decimal() {
    local sign='' value=$1
    if ((value < 0)); then sign=- value=$((-value)); fi
    printf -v REPLY '%s%d.%06d' "$sign" $((value / 1000000)) $((value % 1000000))
}

# Where it stands now: the place it proposed, or its old one if that was taken.
stand() {
    millionths 'location":\{"x'; x=$REPLY
    # Kept as text: it is only reported.
    [[ $line =~ \"location\":\{\"x\":[^,]*,\"y\":([^\}]*)\} ]] && y=${BASH_REMATCH[1]}
}

# Before tick 0, and whenever the run starts again: back to the initial state. Parameters are
# [robot.params] of the scenario, in SI units.
init() {
    stand
    millionths tick_s; tick_us=$REPLY
    # The ends of its stroll; it is on its way to the second.
    millionths walk_m; from=$x to=$((x + REPLY))
    millionths speed_mps; speed=$REPLY
    millionths patience_s; patience_us=$REPLY
    held_up_us=0 # Its measure of progress: how long it has been blocked.
    turns=0 emotion=HAPPY behavior=STROLL
    # Its panel in the console: two buttons that send it commands.
    say '{"type":"panel","widgets":['\
'{"widget":"button","label":"Rest","command":"rest"},'\
'{"widget":"button","label":"Stroll","command":"stroll"}]}'
}

turn() {
    local end=$from
    from=$to to=$end turns=$((turns + 1))
}

# Obeys the commands of the line, one after the other.
obey() {
    local rest=$line sender command
    local one='"from":"([^"]*)","performative":"[^"]*","command":"(([^"\\]|\\.)*)"'
    while [[ $rest =~ $one ]]; do
        sender=${BASH_REMATCH[1]} command=${BASH_REMATCH[2]}
        rest=${rest#*"${BASH_REMATCH[0]}"}
        case $command in
            rest) behavior=REST ;;
            stroll) behavior=STROLL ;;
            # The text is JSON already.
            *) say '{"type":"log","text":"does not know how to '"$command"'"}'; continue ;;
        esac
        say '{"type":"log","text":"obeys '"$sender: $command"'"}'
    done
}

# One tick: from what it perceives to what it does.
tick() {
    local was=$emotion
    stand
    obey

    # Progress.
    # In what stands before the commands: a payload may have any field.
    if [[ ${line%%'"commands":'*} == *'"blocked":true'* ]]; then
        ((held_up_us += tick_us))
    else
        ((held_up_us -= tick_us / 2))
        if ((held_up_us < 0)); then held_up_us=0; fi
    fi

    # The emotion state generator: progress in, emotion out.
    if ((held_up_us >= patience_us)); then emotion=FRUSTRATED; fi
    if ((held_up_us == 0)); then emotion=HAPPY; fi

    # The behavior state generator: emotion in, behavior out.
    if [[ $emotion == FRUSTRATED && $was == HAPPY ]]; then turn; fi
    if ((x == to)); then turn; fi
}

# The end of every tick: where it wants to stand at the next one, and what other robots can query.
finish() {
    local goal=$x now=0 direction=0 step=$((speed * tick_us / 1000000))
    if [[ $behavior == STROLL ]]; then
        now=$speed goal=$to
        if ((to - x > step)); then goal=$((x + step)); fi
        if ((x - to > step)); then goal=$((x - step)); fi
    fi
    if ((to < x)); then direction=3.141593; fi
    local goal_m now_mps held_up_s
    decimal "$goal"; goal_m=$REPLY
    decimal "$now"; now_mps=$REPLY
    decimal "$held_up_us"; held_up_s=$REPLY
    say '{"type":"done","proposal":{"x":'"$goal_m"',"y":'"$y"'},'\
'"speed_mps":'"$now_mps"',"direction_rad":'"$direction"','\
'"emotion_state":"'"$emotion"'","behavior_state":"'"$behavior"'",'\
'"state_variables":{"held_up_s":'"$held_up_s"',"turns":'"$turns"'}}'
}

while IFS= read -r line; do
    case $line in
        '{"type":"init"'*)
            init
            # In the middle of a run it is not answered: the tick that follows at once is.
            if [[ $line == *'"tick":0,'* ]]; then finish; fi
            ;;
        '{"type":"tick"'*) tick; finish ;;
        '{"type":"end"'*) exit 0 ;;
    esac
done
