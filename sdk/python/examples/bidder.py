#!/usr/bin/env python3
"""Shares tasks with others by auction (CBAA): ``crates/robots/src/bidder.rs`` in Python, the same to the last bit."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Optional

from cars import Action, Cars, Point, Robot, SiteAction, main

BID_AT_WORK, ASIDE_TICKS, FORWARD_M = 1.0, 4, 0.3


@dataclass
class Parameters:
    speed: float = 1.0
    work: float = 3.0
    sends: str = "periodically"
    period: float = 0.5
    lease: Optional[float] = None


@dataclass
class Entry:
    bid: float = 0.0
    by: str = ""
    done: bool = False
    renewed_s: float = 0.0


class Bidder(Robot):
    is_quick = True

    def init(self, cars: Cars) -> None:
        self.parameters = cars.parameters(Parameters)
        self.tasks = [site for site in cars.welcome.known_sites if site.kind == "task"]
        self.table = [Entry() for _ in self.tasks]
        self.task: Optional[int] = None
        self.worked_s = self.sent_s = self.sends_s = 0.0
        self.has_changed = False
        self.aside_ticks, self.side = 0, 0.0

    def tick(self, cars: Cars) -> Action:
        self.receive(cars)
        self.look(cars)
        self.drop_lost_task(cars)
        self.renew(cars)
        self.bid(cars)
        action = self.work(cars)
        self.send(cars)
        action.state_variables = {"task": "" if self.task is None else self.tasks[self.task].name}
        return action

    def receive(self, cars: Cars) -> None:
        """Of two bids the higher one counts, and of equal ones that of the robot that comes first by name."""
        for command in cars.commands:
            if command.text != "table":
                continue
            for own, other in zip(self.table, [Entry(**entry) for entry in command.payload]):
                self.expire(other, cars.time_s)
                is_higher = other.bid > own.bid or (other.bid == own.bid and other.by < own.by)
                if is_higher or (other.bid, other.by) == (own.bid, own.by):
                    own.renewed_s = other.renewed_s if is_higher else max(own.renewed_s, other.renewed_s)
                bid, by = (other.bid, other.by) if is_higher else (own.bid, own.by)
                self.update(own, bid, by, own.done or other.done)

    def update(self, entry: Entry, bid: float, by: str, done: bool) -> None:
        self.has_changed = self.has_changed or (entry.bid, entry.by, entry.done) != (bid, by, done)
        entry.bid, entry.by, entry.done = bid, by, done

    def renew(self, cars: Cars) -> None:
        """Renews the bid for its task, and drops those of others that they have not renewed."""
        for index, entry in enumerate(self.table):
            if self.parameters.lease is not None and self.task == index:
                entry.renewed_s = cars.time_s
            self.expire(entry, cars.time_s)

    def expire(self, entry: Entry, now_s: float) -> None:
        lease_s = self.parameters.lease
        if lease_s is not None and now_s - entry.renewed_s > lease_s:
            entry.bid, entry.by = 0.0, ""

    def look(self, cars: Cars) -> None:
        done = {site.name for site in cars.sites if site.state.get("done") is True}
        for entry, task in zip(self.table, self.tasks):
            self.update(entry, entry.bid, entry.by, entry.done or task.name in done)

    def drop_lost_task(self, cars: Cars) -> None:
        if self.task is not None and (self.table[self.task].done or self.table[self.task].by != cars.name):
            self.task, self.worked_s = None, 0.0

    def bid(self, cars: Cars) -> None:
        """Bids for the nearest task that it can get, if it has none: the nearer, the more."""
        if self.task is not None:
            return
        best = 0.0
        for index, (entry, site) in enumerate(zip(self.table, self.tasks)):
            bid = 1.0 / (1.0 + cars.location.distance_m(site.location))
            if not entry.done and bid > max(entry.bid, best):
                self.task, best = index, bid
        if self.task is not None:
            self.update(self.table[self.task], best, cars.name, False)
            self.table[self.task].renewed_s = 0.0 if self.parameters.lease is None else cars.time_s

    def work(self, cars: Cars) -> Action:
        if self.task is None:
            return Action.stay(cars, behavior_state="IDLE")
        task = self.tasks[self.task]
        if all(site.name != task.name for site in cars.sites):
            return self.go(cars, task.location)
        if self.worked_s == 0.0:
            self.update(self.table[self.task], BID_AT_WORK, cars.name, False)
        self.worked_s += cars.tick_s
        action = Action.stay(cars, behavior_state="WORK")
        if self.worked_s >= self.parameters.work:
            action.site_actions = [SiteAction(task.name, set={"done": True}, only_if={"done": False})]
        return action

    def go(self, cars: Cars, goal: Point) -> Action:
        """A step toward a goal; after it was blocked, for some ticks around what is in the way."""
        if cars.was_blocked and self.aside_ticks == 0:
            self.aside_ticks, self.side = ASIDE_TICKS, 1.0 if cars.random.unit() < 0.5 else -1.0
        here = cars.location
        distance_m = here.distance_m(goal)
        if self.aside_ticks > 0 and distance_m > 0.0:
            self.aside_ticks -= 1
            x, y = (goal.x - here.x) / distance_m, (goal.y - here.y) / distance_m
            goal = Point(here.x - self.side * y + FORWARD_M * x, here.y + self.side * x + FORWARD_M * y)
        return Action.go(cars, goal, self.parameters.speed, behavior_state="GO")

    def send(self, cars: Cars) -> None:
        sends, lease_s = self.parameters.sends, self.parameters.lease
        must_renew = self.task is not None and lease_s is not None and cars.time_s - self.sent_s >= 0.5 * lease_s
        has_news = sends == "on_change" and (self.has_changed or must_renew)
        if has_news or (sends == "periodically" and cars.time_s >= self.sends_s):
            self.sent_s, self.sends_s, self.has_changed = cars.time_s, cars.time_s + self.parameters.period, False
            cars.broadcast("table", [vars(entry) for entry in self.table])


if __name__ == "__main__":
    sys.exit(main("Bidder", lambda name: Bidder()))
