#!/usr/bin/env perl
# A visitor who strolls between random points, over standard input and output (`cars exec`). Written from docs/protocol.md
# alone. `./wanderer.pl --check docs/vectors/streams.json` compares its random numbers with the test vectors.
use strict; use warnings; no warnings 'portable';   # 64-bit constants
use JSON::PP;
$| = 1;
my $json = JSON::PP->new->canonical->utf8;
my $SPEED = 0.6;                                   # m/s
my ($REST_S, $ASK_S, $HELLO_S) = (2, 10, 60);      # how long it stands when blocked; how often it asks, greets

# --- random numbers: modulo 2^64, so products and sums wrap (use integer), shifts are unsigned (no integer)
my @s;
sub add { use integer; my $x = $_[0] + $_[1]; no integer; return $x & ~0 }
sub mul { use integer; my $x = $_[0] * $_[1]; no integer; return $x & ~0 }
sub rotl { return (($_[0] << $_[1]) | ($_[0] >> (64 - $_[1]))) & ~0 }
sub seed_stream {
    my ($z, $name) = @_;
    my $h = 0xcbf29ce484222325;
    utf8::encode($name);
    $h = mul($h ^ ord, 0x100000001b3) for split //, $name;
    $z ^= $h;
    @s = map {
        my $x = $z = add($z, 0x9e3779b97f4a7c15);
        $x = mul($x ^ ($x >> 30), 0xbf58476d1ce4e5b9);
        $x = mul($x ^ ($x >> 27), 0x94d049bb133111eb);
        $x ^ ($x >> 31);
    } 1 .. 4;
}
sub next_draw {
    my $result = add(rotl(add($s[0], $s[3]), 23), $s[0]);
    my $t = ($s[1] << 17) & ~0;
    $s[2] ^= $s[0]; $s[3] ^= $s[1]; $s[1] ^= $s[2]; $s[0] ^= $s[3]; $s[2] ^= $t; $s[3] = rotl($s[3], 45);
    return $result;
}
sub unit { return (next_draw() >> 11) / 9007199254740992 }
if (@ARGV and $ARGV[0] eq '--check') {
    open my $file, '<', $ARGV[1] or die "$ARGV[1]: $!";
    for my $v (@{ $json->decode(join '', <$file>) }) {
        seed_stream($v->{seed}, $v->{stream});
        for my $i (0 .. $#{ $v->{draws} }) {
            my @before = @s;
            my $draw = next_draw(); @s = @before; my $unit = unit();
            die "$v->{stream} $i: $draw $unit" unless $draw eq $v->{draws}[$i] and $unit == $v->{units}[$i];
        }
    }
    print "streams agree\n"; exit 0;
}

# --- the robot
my ($init, $target, $host, $tries, $rest, $progress, $greeted, $visits, $seen);
sub say_line { print $json->encode($_[0]), "\n" }
sub ask { say_line({ type => 'query', of => $_[0], what => $_[1] }); return $json->decode(scalar <STDIN>) }
sub distance { my ($p, $q) = @_; return sqrt(($p->{x} - $q->{x}) ** 2 + ($p->{y} - $q->{y}) ** 2) }
sub every { my ($tick, $s) = @_; my $n = int($s / $init->{tick_s} + 0.5) || 1; return $tick > 0 && $tick % $n == 0 }
sub draw_target {
    my ($size, $body) = @{$init}{qw(field_m body_m)};
    my @at = map { $body / 2 + unit() * ($size->[$_] - $body) } 0, 1;
    return { x => $at[0], y => $at[1] };
}
sub begin {
    ($init) = @_;
    my $past = $init->{last_state_variables} || {};
    ($host, $tries, $rest, $progress, $seen) = (undef, 0, 0, 1, '');
    $greeted = $past->{greeted_s} // -$HELLO_S;
    $visits = $past->{visits} // 0;
    seed_stream($init->{seed}, $init->{stream});
    $target = draw_target();
}
sub play {
    my ($m) = @_;
    my ($tick, $at, $now) = ($m->{tick}, $m->{location}, $m->{tick} * $init->{tick_s});
    for my $c (@{ $m->{commands} || [] }) { $host = $c->{from} if $c->{command} eq 'come' }
    if (defined $host) {                           # go to where the sender is; if it cannot be asked, try again
        my $answer = ask($host, 'location');
        if ($answer->{value}) { ($target, $tries, $rest) = ($answer->{value}, 9, 0) }   # tries: blocks until it gives up
        $host = undef if $answer->{value} or $answer->{error} eq 'unknown robot';
    }
    my @others = grep { $_ ne $init->{name} } @{ $init->{roster} };
    if (@others and every($tick, $ASK_S)) {
        my $answer = ask($others[$tick % @others], 'state');
        $seen = $answer->{value}{behavior_state} if $answer->{value};
    }
    my $near = $m->{sensed}[0];
    if ($near and $now - $greeted >= $HELLO_S) {
        say_line({ type => 'command', to => $near->{name}, command => 'hello' });
        say_line({ type => 'log', text => "hello, $near->{name}" });
        $greeted = $now;
    }
    my $left = distance($at, $target);
    if ($left < $init->{body_m} * 2) { $visits++; ($target, $tries) = (draw_target(), 0); $left = distance($at, $target) }
    if ($m->{blocked}) {
        $rest = int($REST_S / $init->{tick_s} + 0.5);
        if ($tries > 0) { $tries-- } else { $target = draw_target() }
    }
    elsif ($rest > 0) { $rest-- }
    my $step = $rest ? 0 : $SPEED * $init->{tick_s};
    $step = $left if $step > $left;
    $progress = $m->{blocked} ? 0 : $step ? ($progress + 0.25 > 1 ? 1 : $progress + 0.25) : $progress;
    my ($dx, $dy) = $step ? (map { ($target->{$_} - $at->{$_}) / $left * $step } qw(x y)) : (0, 0);
    my $emotion = $progress < 0.5 ? 'IMPATIENT' : 'CONTENT';
    my $behavior = !$step ? 'STAND' : $tries ? 'COME' : 'STROLL';
    say_line({ type => 'panel', widgets => [
        { widget => 'badge', label => 'emotion', text => $emotion, tone => $progress < 0.5 ? 'warning' : 'good' },
        { widget => 'face', face => $progress < 0.5 ? 'angry' : 'happy', intensity => 0.5 },
        { widget => 'bar', label => 'progress', value => $progress, min => 0, max => 1 },
        { widget => 'text', label => 'last seen', text => $seen },
        { widget => 'button', label => 'Come', command => 'come' } ] });
    say_line({ type => 'done', proposal => { x => $at->{x} + $dx, y => $at->{y} + $dy },
        speed_mps => $step / $init->{tick_s}, direction_rad => sprintf('%.6f', atan2($dy, $dx)) + 0,
        emotion_state => $emotion, behavior_state => $behavior,
        state_variables => { greeted_s => $greeted, visits => $visits, progress => $progress, seen => $seen } });
}
while (my $line = <STDIN>) {
    my $m = $json->decode($line);
    exit 0 if $m->{type} eq 'end';
    begin($m) if $m->{type} eq 'init';
    play($m) unless $m->{type} eq 'init' and $m->{tick} > 0;
}
exit 1;
