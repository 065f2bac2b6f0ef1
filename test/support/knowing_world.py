# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
A world of publishers, lossy channels and clocks around one source: docs/knowing.md.

The source is the real one, the geometry is not: a body is 'T', which touches the footprint, 'F',
which is far, or 'M', which comes nearer. The world knows what was sent and what was delivered. By
that it decides in each state whether the promises of a source hold: whether clear and the time to
collision are right, and whether the source becomes known again.
"""

from dataclasses import replace
import math

import numpy as np
from sat_collision.geometry.polygon import Polygon
from sat_collision.scene.footprints import Footprint
from sat_collision.scene.prediction import predict
from sat_collision.scene.settings import (
    FootprintSettings, ObstacleSettings, POLYGON, POLYGON_INSTANCE)
from sat_collision.scene.sources import Source
from sat_collision.scene.streams import Endpoint
from sat_collision.scene.velocity import TRANSFORMS, Velocity

SECOND = 10**9
TIMEOUT = 8
PERIOD = 2
SETTLE = 2
# The age of an older stamp, in ns.
_BACK = SECOND // 2
START = 1000
# The distance of a far body from the footprint, which does not move, in m; the speed of one that
# comes nearer, in m/s; and how far apart two messages must and may be for a velocity, in ns.
FAR = 50.0
SPEED = 0.25
_MIN_APART, _MAX_APART = SECOND // 100, 2 * SECOND
HORIZON = 1e4

MODES = ('sets', 'ended sets', 'ids', 'maps')


class Bodies:
    """The contacts of a source, almost without geometry: the distance of each obstacle."""

    changed = frozenset()
    margin = 0.0

    def __init__(self):
        self.placed = {}

    def place_obstacle(self, obstacle, body):
        obstacle.row = 0
        obstacle._polygon = Polygon([(body, 0.0)])
        self.placed[obstacle] = body

    def remove_obstacle(self, obstacle):
        obstacle.row = obstacle._polygon = None
        self.placed.pop(obstacle, None)

    def hide_obstacles(self, group, rows):
        self.placed = {one: body for one, body in self.placed.items() if one.group is not group}

    def first_contact(self, footprint, velocity, seconds, courses):
        first = None
        for obstacle in self.placed:
            polygon, (speed, _) = courses.get(obstacle, (obstacle.polygon, (0.0, 0.0)))
            time = time_of(polygon.vertices[0, 0], speed)
            if time <= min(seconds, first[1] if first else math.inf):
                first = obstacle, time
        return first


def time_of(place, speed):
    """Return when a body at a distance and with a speed reaches the footprint."""
    return 0.0 if place <= 0.0 else place / -speed if speed < 0.0 else math.inf


class Message:
    """
    A message as it was sent; body is 'T', 'F', 'M', None for an empty polygon, or a refusal.

    `place` is its distance; `time`, once delivered, when it counts from.
    """

    def __init__(self, number, stamp, body, key, listing):
        self.number = number
        self.stamp = stamp
        self.body = body
        self.key = key
        self.listing = listing
        self.is_delivered = False
        self.order = 0
        self.place = {'T': 0.0, 'F': FAR, 'M': FAR - SPEED * (stamp / SECOND - START)}.get(body)


class Publisher:
    """
    A process that publishes: what it has sent, what is in transit, and what it will send.

    One that starts numbering at a higher number is a second instance of the same node.
    """

    def __init__(self, gid, node, numbers_from):
        self.gid = gid
        self.node = node
        self.number = numbers_from
        self.is_alive = True
        self.sent = []
        self.queue = []
        self.plan = []
        self.listing = 0
        self.refreshed = {}
        self.is_beside_others = False

    def send(self, stamp, body, key):
        self.number += 1
        message = Message(self.number, stamp, body, key, self.listing)
        self.sent.append(message)
        self.queue.append(message)
        return message

    @property
    def delivered(self):
        return [one for one in self.sent if one.is_delivered]


class World:
    """
    One source and everything that can happen to it; events are strings, see `options`.

    Parameters
    ----------
    mode : str
        One of MODES.
    source : type, optional
        The class of the source.

    """

    def __init__(self, mode, source=Source):
        self.mode = mode
        self.now = START
        self.bodies = Bodies()
        self.source = source(ObstacleSettings(
            'obstacle', '/obstacles', set_window=0.0,
            type=POLYGON_INSTANCE if mode in ('ids', 'maps') else POLYGON,
            timeout=0.0 if mode == 'maps' else float(TIMEOUT),
            settle_time=float(SETTLE), moving=mode == 'ids'), self.bodies)
        self.footprint = Footprint(FootprintSettings('robot', '/robot', timeout=0.0))
        self.publishers = []
        self.graph = []
        self.known_graph = []
        self.deliveries = 0
        self.numbered = set()
        self.start('a')
        self.do('news')
        if mode == 'ids':
            self._become_known()

    def _become_known(self):
        """Let the first publisher of ids be received for a whole timeout."""
        own = self.publishers[0]
        for _ in range(TIMEOUT + 1):
            for key, body in ((1, 'T'), (2, 'F')):
                self._send_body(own, key, body)
                self._deliver(own)
            self._tick()

    # --- what can happen

    def options(self):
        """Return the events that can happen now."""
        own, second = self.live(False), self.live(True)
        if any(one.delivered and one not in self.known_graph for one in self.graph):
            # A6: only number 1 may arrive before its publisher is announced.
            return ['news']
        options = [] if self.mode == 'maps' and self._is_busy() else ['tick', 'tick:3']
        if own is None:
            options += ['start:a', 'start:b']
        else:
            if own.plan:
                options.append('send')
            elif self.mode == 'ids':
                options += ['key:T', 'key:F', 'key:M', 'key:other', 'key:refused',
                            'key:unreadable', 'key:old', 'key:ahead']
            else:
                options += [f'list:{bodies}' for bodies in ('F', 'FT', 'TF', 'R', 'U')]
            # Settling assumes that a map is sent and received without a pause, or a death.
            options += ['kill', 'end'] if self.mode != 'maps' or not self._is_busy() else []
        if second is not None:
            options.append('second:send')
            if self.mode != 'maps' or not second.queue:
                options.append('second:end')
        elif not any(one.is_second for one in self.publishers):
            options += ['second:start', 'second:namesake']
        for k, one in enumerate(self.publishers):
            if one.queue:
                # The loss of a map's last message is noticed only if another one follows.
                if self.mode != 'maps' or len(one.queue) > 1 or one.plan:
                    options.append(f'lose:{k}')
                if one in self.known_graph or one.queue[0].number == 1:
                    options.append(f'get:{k}')
        if self.graph != self.known_graph:
            options.append('news')
        if any(not one.is_alive for one in self.graph):
            options.append('lease')
        if self.mode in ('ended sets', 'maps'):
            options.append('clock back')
        if self.mode != 'maps':
            options.append('timeout')
        return options

    def do(self, event):
        """Let an event happen."""
        what, _, detail = event.partition(':')
        own = self.live(False)
        if what == 'tick':
            for _ in range(int(detail or 1)):
                self._tick()
        elif what == 'send':
            self._send(own)
        elif what == 'list':
            self._plan(own, detail)
            self._send(own)
        elif what == 'key':
            self._send_key(own, detail)
        elif what in ('kill', 'end'):
            self._stop(own, is_orderly=what == 'end')
        elif what == 'start':
            self.start(detail)
        elif event == 'second:start':
            self.start('second', is_second=True)
        elif event == 'second:namesake':
            # It started earlier, hung, and has already sent many messages.
            self.start('a', is_second=True)
        elif event == 'second:send':
            self._send_second()
        elif event == 'second:end':
            self._stop(self.live(True), is_orderly=True)
        elif what == 'get':
            self._deliver(self.publishers[int(detail)])
        elif what == 'lose':
            self.publishers[int(detail)].queue.pop(0)
        elif what == 'news':
            self._update_graph()
        elif what == 'lease':
            for one in [one for one in self.graph if not one.is_alive]:
                self._leave(one)
        elif what == 'timeout':
            # To one that is too short for this publisher, or back.
            settings = self.source.settings
            self.source.configure(
                replace(settings, timeout=TIMEOUT * 1.5 - settings.timeout), self.now * SECOND)
        elif what == 'clock back':
            self.now -= 1
            self.source.set_back(self.now * SECOND)

    def live(self, is_second):
        """Return the publisher that lives, the second one or the other."""
        return next((one for one in self.publishers
                     if one.is_alive and one.is_second is is_second), None)

    def start(self, node, is_second=False):
        """Start a publisher; messages of a dead one do not arrive after that."""
        for one in self.publishers:
            if not one.is_alive:
                one.queue.clear()
        gid = str(len(self.publishers))
        publisher = Publisher(gid, f'/{node}', 50 if is_second and node == 'a' else 0)
        publisher.is_second = is_second
        self.publishers.append(publisher)
        self.graph.append(publisher)

    def _tick(self):
        self.now += 1
        own = self.live(False)
        if self.mode == 'ids' and own is not None:
            for key, (body, stamp) in [*own.refreshed.items()]:
                # A3: a publisher of ids refreshes each obstacle within the timeout.
                if self.now * SECOND - stamp >= (TIMEOUT - 2) * SECOND:
                    self._send_body(own, key, body)
        self._pass_time()

    def _pass_time(self):
        now = self.now * SECOND
        if self.source.deadline < now:
            self.source.pass_time(now)

    def _is_busy(self):
        """Tell whether a map is in transit: maps are sent and delivered without a pause."""
        return any(one.is_alive and (one.plan or one.queue) for one in self.publishers)

    def _plan(self, publisher, bodies):
        publisher.listing += 1
        stamp = self.now * SECOND + publisher.listing
        publisher.plan = [(stamp, body) for body in bodies]
        if self.mode == 'ended sets' or (self.mode == 'maps' and publisher.listing > 1):
            publisher.plan.append((stamp, None))

    def _send(self, publisher):
        stamp, body = publisher.plan.pop(0)
        # In maps each obstacle of each listing has an id of its own.
        publisher.send(stamp, body, publisher.number)

    def _send_body(self, publisher, key, body):
        stamp = self.now * SECOND
        publisher.refreshed[key] = body, stamp
        publisher.send(stamp, body, key)

    def _send_key(self, own, detail):
        stamp = self.now * SECOND
        if detail in ('T', 'F', 'M'):
            self._send_body(own, 1, detail)
        elif detail == 'other':
            self._send_body(own, 2, 'F')
        elif detail == 'old':
            own.send(stamp - _BACK, 'F', 1)
        elif detail == 'ahead':
            own.send(stamp + _BACK, 'F', 2)
        else:
            body = own.refreshed.get(1, ('F', 0))[0]
            own.refreshed[1] = body, stamp
            own.send(stamp, 'R' if detail == 'refused' else 'U', 1)

    def _send_second(self):
        second = self.live(True)
        if self.mode == 'ids':
            second.send(self.now * SECOND, 'F', 1)
        else:
            second.listing += 1
            stamp = self.now * SECOND + second.listing
            second.send(stamp, 'F', second.number)
            if self.mode != 'sets':
                second.send(stamp, None, None)

    def _stop(self, publisher, is_orderly):
        publisher.is_alive = False
        publisher.plan = []
        if is_orderly:
            self._leave(publisher)

    def _leave(self, publisher):
        # A5: all that a publisher sent is received before its end is announced.
        publisher.queue.clear()
        self.graph.remove(publisher)

    def _update_graph(self):
        self.known_graph = [*self.graph]
        self.source.update_publishers(
            [Endpoint(one.gid, one.node) for one in self.graph], self.now * SECOND)
        self._renew()

    def _renew(self):
        if self.source.wants_history and not self.source.stream.faults():
            # A publisher of maps keeps what it has sent.
            self.source.renew(self.now * SECOND)
            own, = self.known_graph[-1:]
            self.deliveries += 1
            own.queue[:0] = [one for one in own.sent if one not in own.queue]
            while own.queue:
                self._deliver(own)

    def _deliver(self, publisher):
        message = publisher.queue.pop(0)
        message.is_delivered = True
        publisher.is_beside_others |= self.known_graph != [publisher]
        self.deliveries += 1
        message.order = self.deliveries
        source, now = self.source, self.now * SECOND
        place, stamp, key = message.place, message.stamp, message.key
        message.time = min(stamp, now)
        if message.body == 'U':
            stamp, key = None, None
        refusal = {'U': 'unreadable', 'R': 'refused'}.get(message.body)
        source.receive(place, 'map', stamp, now, key, message.number, refusal)
        if self.mode == 'ids' and place is not None:
            source.track(key, message.time, np.array([(place, 0.0)]))

    # --- what is right

    @property
    def is_clear(self):
        """Whether the source gives no reason against clear, with the timeout that it needs."""
        return self._has_timeout and not self.source.faults and all(self.bodies.placed.values())

    @property
    def _has_timeout(self):
        return self.source.settings.timeout in (0.0, TIMEOUT)

    @property
    def prediction(self):
        """What is predicted of a footprint that stands."""
        footprint, now = self.footprint, self.now * SECOND
        footprint.time = now
        footprint._polygon = Polygon([(0.0, 0.0)])
        still = Velocity((0.0,) * 3, (0.0,) * 3, TRANSFORMS)
        footprint.motion.place(now, np.zeros((1, 2)), still)
        footprint.contacts = {one for one, place in self.bodies.placed.items() if not place}
        footprint.evaluate(now, '', self.source.faults, 0)
        return predict(footprint, self.bodies, [self.source], now, HORIZON)

    def is_late(self):
        """Tell whether a time to collision is really late, or given while unknown."""
        found = self.prediction
        if not (self._has_timeout and found and found.is_known) or found.seconds == 0.0:
            return False
        if self.mode != 'ids':
            return not self.may_be_clear()
        counted = [one for one in self.known_graph if not self._is_ghost(one)]
        newest = self._newest_ids(counted[0]) if len(counted) == 1 else None
        return newest is None or any(
            found.seconds > self._time_of(counted[0], message) + 1e-6
            for message in newest.values())

    def _time_of(self, one, last):
        """Return when the obstacle of a message really reaches the footprint, -inf if unknown."""
        before, taken = None, -math.inf
        for message in one.delivered:
            if message.key == last.key and message.time >= taken:
                taken = message.time
                is_apart = _MIN_APART <= last.time - message.time <= _MAX_APART
                before = message if is_apart and message.place is not None else before
        if before is None or last.place is None:
            return -math.inf
        speed = (last.place - before.place) / (last.time - before.time) * SECOND
        age = self.now - last.time / SECOND
        if speed and age * SECOND > _MAX_APART:
            return -math.inf
        return max(time_of(last.place, speed) - age, 0.0)

    def may_be_clear(self):
        """Tell whether the source may really be clear."""
        counted = [one for one in self.known_graph if not self._is_ghost(one)]
        return len(counted) == 1 and self._has_clear_listing(counted[0])

    def _is_ghost(self, one):
        """Tell whether a newer publisher of the same node has sent, and this one not since."""
        newer = [other for other in self.known_graph[self.known_graph.index(one) + 1:]
                 if other.node == one.node and other.delivered]
        if not newer:
            return False
        begun = min(message.order for message in newer[-1].delivered)
        return all(message.order < begun for message in one.delivered)

    def _has_clear_listing(self, one):
        if self.mode == 'ids':
            return self._has_clear_ids(one)
        oldest = 0 if self.mode == 'maps' else (self.now - TIMEOUT) * SECOND
        listings = {}
        for message in one.sent:
            listings.setdefault(message.listing, []).append(message)
        under_way = one.listing if one.plan else None
        for number, messages in listings.items():
            newer = [message for other in self.publishers for message in other.delivered
                     if message.body == 'T' and (
                         other is one and message.listing > number)]
            if (number != under_way and all(message.is_delivered for message in messages)
                    and min(message.stamp for message in messages) >= oldest
                    and all(message.body in ('F', None) for message in messages)
                    and not newer):
                return True
        return False

    def _has_clear_ids(self, one):
        """Tell whether all of one timeout has arrived, with every key last seen far away."""
        newest = self._newest_ids(one)
        return newest is not None and all(message.place for message in newest.values())

    def _newest_ids(self, one):
        """Return the newest message of each key, None if not all of one timeout has arrived."""
        if not one.delivered:
            return None
        last = max(min(message.stamp, self.now * SECOND) for message in one.delivered)
        if last < (self.now - TIMEOUT) * SECOND:
            return None
        begin = last - TIMEOUT * SECOND
        # An obstacle stamped exactly at the beginning is sent again by the end.
        if any(not message.is_delivered for message in one.sent
               if message.stamp > begin and message.number < one.delivered[-1].number):
            return None
        newest = {}
        for message in one.delivered:
            held = newest.get(message.key)
            if message.stamp >= begin and (held is None or message.stamp >= held.stamp):
                newest[message.key] = message
        return newest

    def heals(self):
        """End all faults; return whether the source is soon known, and finally clear."""
        if not self._has_timeout:
            self.do('timeout')
        for one in self.publishers:
            one.queue.clear()
            if one.is_second and one.is_alive:
                self._stop(one, is_orderly=True)
        own = self.live(False)
        if own is not None or not self._can_respawn():
            self.do('lease')
        self.do('news')
        if own is None:
            self.start(self.graph[-1].node[1:] if self.graph else 'a')
            self.do('news')
            own = self.live(False)
        elif self.mode == 'maps' and not self._keeps_its_map(own):
            return False
        own.plan.clear()
        own.refreshed.clear()
        known_after = None
        for period in range(1, TIMEOUT + 6):
            self._tick_to(self.now + PERIOD)
            if self.mode == 'ids':
                self._send_body(own, 2, 'F')
            else:
                self._plan(own, 'F')
                while own.plan:
                    self._send(own)
            while own.queue:
                self._deliver(own)
            self._renew()
            if known_after is None and not self.source.faults:
                known_after = period
        soon = 3 if self.mode != 'ids' else TIMEOUT // PERIOD + 1
        return known_after is not None and known_after <= soon and (
            self.is_clear or len(self.graph) > 1)

    def _can_respawn(self):
        """Tell whether the next instance of a killed node is recognised as such."""
        return (len(self.graph) == 1 and bool(self.graph[0].delivered)
                and self.graph == self.known_graph and not self.graph[0].is_beside_others
                and not any(one.is_second for one in self.publishers))

    def _keeps_its_map(self, own):
        """Tell whether a map sent long ago is known, if there was one."""
        if own.plan or not own.sent or any(one.body in ('R', 'U') for one in own.sent):
            return True
        if not all(one.is_delivered for one in own.sent) and not self.source.wants_history:
            return True
        for _ in range(3):
            self._renew()
            self._tick_to(self.now + SETTLE)
        return not self.source.faults

    def _tick_to(self, time):
        while self.now < time:
            self._tick()


def replayed(mode, events, source=Source):
    """Return the world after these events."""
    world = World(mode, source)
    for event in events:
        world.do(event)
    return world
