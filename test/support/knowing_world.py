# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A world around one source, and whether its monitor keeps the promises of docs/knowing.md in it.

The world knows what was sent and what was delivered. By that it decides in each state whether the
footprint may be clear, whether its time to collision is right, and whether the source becomes
known again once all faults end.
"""

from math import inf

from builders import SECOND
from knowing_events import (
    bytes_of, CORRECTED, DEPTH, Events, MOVING, stamp_of, TIMEOUT, TOLERANCE)
from sat_collision.scene.footprints import Status
from sat_collision.scene.settings import EACH_MESSAGE, EMPTY_POLYGON, NEVER

PERIOD = 2 * SECOND
# A map may be known for so long while the next one is open.
LONGEST_OPEN = SECOND
# Two messages so far apart give a velocity, in s, which lasts as long.
_MIN_APART, _MAX_APART = 0.01, 2.0
# The rounding of a time to collision, in s.
_ROUNDING = 1e-2


class World(Events):
    """One source, everything that can happen to it, and what is right then."""

    @property
    def is_clear(self):
        """Whether the footprint is clear, with the timeout that the publisher knows."""
        scene = self.monitor.scene
        if not scene.footprints:
            self.monitor.receive('robot', bytes_of('T', 0), self.now)
        return self._has_timeout and scene.status('robot') is Status.CLEAR

    @property
    def _has_timeout(self):
        source, = self.settings.obstacles
        return source.timeout in (0.0, TIMEOUT / SECOND)

    def is_late(self):
        """Tell whether a time to collision is later than the contact of what was received."""
        if not self.moves or not self.is_clear:
            return False
        for stamp in (self.now - SECOND // 10, self.now):
            self.monitor.receive('robot', bytes_of('T', stamp), self.now)
        found = self.monitor.scene.prediction('robot')
        return found.is_known and any(
            found.seconds > self._time_to(message) + _ROUNDING
            for message in self._held(self._delivered()) if message.body == 'M'
            # What was told before, and what is forgotten, need not count.
            and message.epoch_in == self.epoch and message.publisher is self.told[-1]
            and stamp_of(message) >= self.now - TIMEOUT)

    def _time_to(self, last):
        """Return when the obstacle of a message is in contact, as it moved until then."""
        others = [(one, (stamp_of(last) - stamp_of(one)) / SECOND)
                  for one in last.publisher.delivered
                  if one.key == last.key and one.body in ('T', 'F', 'M')]
        speeds = [(one.place - last.place) / apart for one, apart in others
                  if _MIN_APART <= apart <= _MAX_APART]
        age = (self.now - stamp_of(last)) / SECOND
        if age > _MAX_APART:
            return -inf
        return max((max(last.place / speed - age, 0.0) if speed > 0.0 else inf
                    for speed in speeds), default=-inf)

    def may_be_clear(self):
        """Tell whether the footprint may really be clear."""
        return any(self._is_right([one for one in told if not self._is_ghost(one, told)])
                   for told in (self.told, *self.waits_since))

    def _is_right(self, counted):
        if len(counted) != 1:
            return False
        one, = counted
        return (self._has_clear_bodies if self.mode.is_refreshed else self._has_clear_listing)(one)

    def _is_ghost(self, one, told):
        """Tell whether a newer publisher of the same node has sent, and this one not since."""
        newer = [other for other in self.seen[self.seen.index(one) + 1:]
                 if other in told and other.node == one.node and other.delivered]
        if not newer:
            return False
        begun = min(message.order for message in newer[-1].delivered)
        return all(message.order < begun for message in one.delivered)

    def _touches(self, message):
        """Tell whether a message may be of a body that touches the footprint."""
        if message.body is None or not message.order or self._waits(message):
            return False
        return (message.is_refused or message.placed_by == NEVER
                or ('F' if self.corrected else 'T') in message.body)

    def _is_well(self, message):
        """Tell whether a message was received, and is of nothing that touches."""
        return message.order and message.placed_by < NEVER and not self._touches(message)

    def _has_clear_listing(self, one):
        oldest = -NEVER if self.mode.is_map else self.now - TIMEOUT
        listings = {}
        for message in one.sent:
            listings.setdefault(message.listing, []).append(message)
        for number in one.complete & listings.keys():
            messages = listings[number]
            end = messages[-1]
            bodies = [message for message in messages if message.body] or [end]
            if (all(self._is_well(message) for message in messages)
                    and min(message.time for message in bodies) >= oldest
                    and (self.mode.is_map or end.epoch_in == self.epoch)
                    and not any(self._touches(message) for message in self._after(end))
                    and not (self.mode.is_map and self._is_doubtful(one, end))
                    and not (self.mode.set_end == EACH_MESSAGE and not self.mode.is_map
                             and self._is_overtaken(one, end))):
                return True
        return False

    def _after(self, end):
        """Return the messages that came after the end of a listing."""
        return [message for message in self._delivered() if (
            message.number > end.number if message.publisher is end.publisher
            else message.order > end.order)]

    def _is_doubtful(self, one, end):
        """Tell whether a map may have been changed after a listing."""
        after = [message for message in one.sent if end.number < message.number <= one.newest]
        return any(not message.order for message in after) or any(
            max(message.arrival, min(message.placed_by, message.until)) + LONGEST_OPEN < self.now
            for message in after
            if message.listing not in one.complete or not all(
                other.order for other in one.sent if other.listing == message.listing))

    def _is_overtaken(self, one, end):
        """Tell whether a set of one was received before, which is newer and touches."""
        touching = None
        for message in sorted(one.delivered, key=lambda message: message.order):
            if message is end:
                return touching is not None and touching.time >= self.now - TIMEOUT and (
                    stamp_of(end) < stamp_of(touching))
            if not message.is_refused and message.placed_by < NEVER and (
                    message.epoch_in == self.epoch) and (
                    touching is None or stamp_of(message) >= stamp_of(touching)):
                touching = message if self._touches(message) else None
        return False

    def _has_clear_bodies(self, one):
        """Tell whether all of one timeout has arrived, with all bodies last seen far away."""
        for last in one.delivered:
            stamp = last.stamp or last.arrival
            begin = stamp - TIMEOUT
            if (last.time < self.now - TIMEOUT or last.epoch != self.epoch or last.body == 'U'
                    or last.stamp == 0 and last.body is None
                    or begin < max(self.epoch_begun, one.begun + self.now - self.steady)):
                continue
            window = [message for message in one.sent if message.number <= last.number
                      and (message.stamp or message.arrival or stamp) >= begin]
            if all(message.order and message.placed_by < NEVER for message in window) and (
                    not any(map(self._touches, self._held(window + self._after(last))))):
                return True
        return False

    def _held(self, messages):
        """Return those of the messages that no newer one of their id replaces."""
        held = []
        for message in sorted(messages, key=lambda message: message.order):
            same = [one for one in held if message.key and one.key == message.key
                    and one.publisher is message.publisher and message.body != 'U'
                    and one.body != 'U']
            if same and message.stamp > max(one.stamp for one in same):
                held = [one for one in held if one not in same]
            held.append(message)
        return held

    # --- that it heals

    def heals(self):
        """End all faults; return whether the source is soon known, and finally clear."""
        if not self.source.settings.enabled:
            self.do('switch')
        if not self._has_timeout:
            self.do('timeout')
        own = self.live(False)
        for one in self.publishers:
            if one is not own or not self.mode.is_map:
                one.queue.clear()
            if one.is_second and one.is_alive:
                self._stop(one, is_orderly=True)
        if own is not None or not self._can_respawn():
            self.do('lease')
        self.do('news')
        if own is None:
            self.start(self.graph[-1].node[1:] if self.graph else 'a')
            own = self.live(False)
            self.do(f'matched:{own.gid}')
        if self.mode.frame == CORRECTED and self.corrected is not False or self.mode.frame == (
                MOVING):
            self.do('transform')
        while own.plan:
            self._send(own)
        own.stamps = ''
        own.sees = False
        if self.mode.is_map:
            for _ in range(3):
                self._settle(own)
                self._let_pass(PERIOD)
            if self._is_latched(own) or self.is_clear:
                return self.is_clear
        stream = self.source.stream
        soon = self.now + (3 * PERIOD if self.mode.set_end in (EMPTY_POLYGON, EACH_MESSAGE)
                           else TIMEOUT + TOLERANCE + 2 * PERIOD)
        if stream.mixed_until < NEVER:
            soon += SECOND if self.mode.is_map else TIMEOUT
        end = self.now + 3 * TIMEOUT
        while self.now < end:
            self._let_pass(PERIOD)
            if self.mode.is_refreshed:
                self._send_body(own, 'F')
            else:
                self._plan(own, 'F')
                while own.plan:
                    self._send(own)
            self._settle(own)
            if self.source.faults and self.now > soon:
                return False
            if not self.source.faults and len(self.graph) > 1:
                # What a map had before stays until the one before has gone.
                self.do('lease')
                self.do('news')
            if self.is_clear:
                return True
        return False

    def _can_respawn(self):
        """Tell whether the next instance of a killed node is recognised as such."""
        return (len(self.graph) == 1 and bool(self.graph[0].delivered) and self.graph[0].is_joined
                and self.graph == self.matched == self.told and self.graph[0].is_named
                and not self.graph[0].is_beside_others
                # Where the clock was set, what waited was dropped.
                and not (self.mode.frame == MOVING and self.epoch)
                and not any(one.is_second for one in self.publishers))

    def _is_latched(self, own):
        """Tell whether the last listing that a publisher of maps keeps is whole and clear."""
        kept = own.sent[-DEPTH:]
        last = [message for message in kept if message.listing == own.listing]
        has_begin = last and (last[0].number == 1 or last[0] is not kept[0])
        return (has_begin or self.mode.set_end == EACH_MESSAGE) and bool(last) and all(
            message.body in ('F', None) for message in last)

    def _settle(self, own):
        """Let all come that was sent, and again what is kept where that is asked for."""
        if self.mode.frame == MOVING:
            self._transform()
        self._deliver(own, len(own.queue))
        if self.monitor.scene.wants_history('obstacle'):
            self._renew()
            self._deliver(own, len(own.queue))

    def _let_pass(self, time):
        self.now += time
        self.steady += time
        self._advance()


def replayed(mode, events):
    """Return the world after these events."""
    world = World(mode)
    for event in events:
        world.do(event)
    return world
