# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What can happen around one source: publishers, lossy channels, transforms and clocks.

The monitor is the real one. What was sent and what was delivered is kept, for `knowing_world`.
A body is 'T', which touches the footprint, 'F', which is far, 'M', which is far and comes nearer,
None for an empty polygon, 'R' for one that is refused, or 'U' for bytes that cannot be read. Times
are in ns.
"""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

from builders import box, collection, SECOND, serialised, transforms
from sat_collision.monitor import Monitor
from sat_collision.scene.settings import (
    EACH_MESSAGE, EMPTY_POLYGON, FootprintSettings, NEVER, NEW_STAMP, NONE, ObstacleSettings,
    POLYGON, POLYGON_COLLECTION, POLYGON_INSTANCE, Settings)
from sat_collision.scene.streams import Endpoint

MAX_COUNT = 3

MOVING, CORRECTED = 'moving', 'corrected'


class Mode(NamedTuple):
    """What the publisher means, as its source is configured."""

    set_end: str
    type: str = POLYGON  # noqa: A003, the parameter's name
    is_map: bool = False
    frame: str = ''  # whether bodies wait for a frame that moves, or are in one that is corrected
    stamps: tuple = ('own', 'stand', 'back', 'ahead', 'zero')
    has_numbers: bool = True  # whether the middleware numbers messages

    @property
    def is_refreshed(self):
        return self.set_end == NONE


MODES = {
    'unmarked': Mode(NONE),
    'marked': Mode(EMPTY_POLYGON),
    'marked, own stamps': Mode(EMPTY_POLYGON, stamps=()),
    'new stamp': Mode(NEW_STAMP, stamps=('back', 'ahead')),
    'each message': Mode(EACH_MESSAGE, stamps=('stand', 'back', 'ahead', 'zero')),
    'ids': Mode(NONE, POLYGON_INSTANCE),
    'marked ids': Mode(EMPTY_POLYGON, POLYGON_INSTANCE),
    'marked, no numbers': Mode(EMPTY_POLYGON, has_numbers=False),
    'collections': Mode(EACH_MESSAGE, POLYGON_COLLECTION),
    'collections, no numbers': Mode(EACH_MESSAGE, POLYGON_COLLECTION, has_numbers=False),
    'marked maps': Mode(EMPTY_POLYGON, POLYGON_INSTANCE, True,
                        stamps=('own', 'back', 'ahead', 'zero', 'reset')),
    'maps of one': Mode(EACH_MESSAGE, is_map=True, stamps=('back', 'ahead', 'zero', 'reset')),
    'maps in a frame': Mode(EMPTY_POLYGON, is_map=True, frame=CORRECTED, stamps=('reset',)),
    'maps as collections': Mode(EACH_MESSAGE, POLYGON_COLLECTION, True, frame=CORRECTED,
                                stamps=('back', 'zero', 'reset')),
    'unmarked, waiting': Mode(NONE, frame=MOVING, stamps=('back',)),
    'marked, waiting': Mode(EMPTY_POLYGON, frame=MOVING, stamps=('back',)),
    'collections, waiting': Mode(EACH_MESSAGE, POLYGON_COLLECTION, frame=MOVING, stamps=('back',)),
    'ids, waiting': Mode(NONE, POLYGON_INSTANCE, frame=MOVING, stamps=('back',)),
}

# How far away 'F' is, in m, and the speed of 'M', which was there at the start, in m/s.
FAR = 49.0
SPEED = 0.1
_PLACES = {'T': box(0.0), 'F': box(1.0 + FAR), None: [], 'R': [(0, 0), (1, 1), (1, 0), (0, 1)]}


@cache
def bytes_of(body, stamp, frame_id='map', key=None, is_collection=False, place=0.0):
    if body == 'M':
        data = serialised(box(1.0 + place), stamp, frame_id, key)
    elif is_collection:
        data = collection([_PLACES[one] for one in body or '' if one != 'U'], stamp, frame_id)
    else:
        data = serialised(_PLACES['F' if body == 'U' else body], stamp, frame_id, key)
    return data[:-3] if body == 'U' else data


def stamp_of(message):
    return message.stamp or message.arrival


class Message:
    """A message as it was sent, and what has become of it."""

    def __init__(self, publisher, number, stamp, body, key):
        self.publisher = publisher
        self.number = number
        self.stamp = stamp
        self.body = body
        self.key = key
        self.listing = publisher.listing
        self.place = 0.0  # the distance of its body from the footprint, in m
        self.epoch = 0  # of the clocks, when it was sent
        self.order = 0  # among all that was delivered, 0 if it was not
        self.time = 0  # that it counts from
        self.arrival = self.epoch_in = 0
        self.until = 0  # when it waits no more
        # Or because it is from the future, or has too many polygons.
        self.is_refused = bool({*(body or '')} & {*'RU'})
        self.placed_by = NEVER  # when its transform had come; it waits until then


class Publisher:
    """
    A process that publishes: what it has sent, what is in transit, and what it will send.

    It sees a body that touches, or does not, and sends what it sees within each timeout.
    """

    def __init__(self, gid, node, now, number=0, is_second=False):
        self.gid = gid
        self.node = node
        self.number = number
        self.newest = 0  # the greatest number that was received, or dropped since
        self.is_second = is_second
        self.begun = now
        self.is_alive = self.sees = True
        self.refreshed = now  # when it sent the body that it sees, by the steady clock
        self.sent = []
        self.queue = []
        self.plan = []
        self.listing = 0
        self.complete = set()  # listings of which all was sent
        self.stamps = ''
        self.is_named = True
        self.is_beside_others = False  # whether something came while others were there
        self.is_joined = False  # whether anything came since it was subscribed to

    @property
    def delivered(self):
        return [one for one in self.sent if one.order]


TIMEOUT = 8 * SECOND
TOLERANCE = SECOND
START = 1000 * SECOND
# A transform may come so late.
TRANSFORM_TIMEOUT = 3 * SECOND // 2
# A clock that stands does so for no longer.
STANDS = SECOND
# How many messages a publisher of maps keeps: a mark, and two listings with theirs.
DEPTH = 2 * MAX_COUNT + 1
# Where the frame of a map is corrected to, all that was far touches, and the other way round.
_CORRECTION = -50.0


class Events:
    """
    One source and all that can happen to it; events are strings, see `options`.

    Parameters
    ----------
    mode : str
        One of MODES.

    """

    def __init__(self, mode):
        self.mode = MODES[mode]
        self.moves = mode == 'ids'
        # Where it bounds a listing; not what else is held, or waits.
        self.max_count = 20 * MAX_COUNT if (
            self.mode.is_refreshed or self.mode.frame == MOVING) else MAX_COUNT
        self.own_stamps = mode == 'marked, own stamps'
        self.now = self.steady = START
        self.settings = Settings(
            (FootprintSettings('robot', '/robot', timeout=0.0),),
            (ObstacleSettings(
                'obstacle', '/obstacles', self.mode.type, self.mode.set_end,
                timeout=0.0 if self.mode.is_map else TIMEOUT / SECOND,
                assume_no_loss=not self._may_lose, moving=self.moves,
                max_count=self.max_count),),
            frame_id='map', transform_timeout=TRANSFORM_TIMEOUT / SECOND, max_tf_gap=1e3,
            future_tolerance=TOLERANCE / SECOND, horizon=1e4)
        self.monitor = Monitor(self.settings, transforms=True)
        self.monitor.scene.tracks_motion = self.moves
        self.publishers = []
        self.graph = []  # as the middleware has it
        self.seen = []  # in the order in which the monitor was told of them
        self.matched = []  # of which messages can be received
        self.reported = []  # as the monitor was told
        self.waits_since = []  # what was reported before something waited
        self.deliveries = 0
        self.epoch = 0
        self.epoch_begun = self.latest = -NEVER
        self.placed_at = -NEVER  # the stamp of the newest transform
        self.corrected = None  # whether the frame of a map is where it was corrected to
        if self.mode.frame == MOVING:
            self._transform()
        self.start('a')
        self.do('matched:0')

    # --- what can happen

    def options(self):
        """Return the events that can happen now."""
        own, second = self.live(False), self.live(True)
        again = [k for k, one in enumerate(self.publishers) if one in self.matched and one.queue]
        if self.source.stream.again_until < NEVER and again:
            # What is sent again comes at once where it is not known up to which number.
            return [f'all:{k}' for k in again]
        options = ['tick', 'tick:3']
        if own is None:
            options += ['start:a', 'start:b']
        else:
            if own.plan:
                options.append('send')
            elif self.mode.is_refreshed:
                options += ['send:T', 'send:F', 'send:gone', 'send:R', 'send:U', 'send:empty']
                options += ['send:0T', 'send:0F'] * (self.mode.type == POLYGON_INSTANCE)
                options += ['send:M'] * self.moves
            elif self.mode.set_end == EACH_MESSAGE:
                options += [f'list:{bodies}' for bodies in ('F', 'T', 'R', 'U', '', *(
                    ('FT', 'FR', 'FFFFT') if self.mode.type == POLYGON_COLLECTION else ()))]
            else:
                options += [f'list:{bodies}' for bodies in (
                    'F', 'FT', 'TF', 'FFT', 'R', 'U', '', 'FFFFT')]
            if not own.plan:
                options += [f'stamps:{one}' for one in ('', *self.mode.stamps)
                            if one != own.stamps]
            options += ['kill', 'end']
        if second is not None:
            options += ['second:F', 'second:T', 'second:end']
        elif not any(one.is_second for one in self.publishers):
            # A6: only numbers show that one of the same name lives.
            options += ['second:start', 'second:namesake'][:1 + self.mode.has_numbers]
        for k, one in enumerate(self.publishers):
            if one.queue:
                # Of a map that is kept, neither the first nor the last message is lost.
                if self._may_lose and (
                        not self.mode.is_map or one.is_joined and len(one.queue) > 1):
                    options.append(f'lose:{k}')
                if one in self.matched:
                    options += [f'get:{k}', f'all:{k}']
            if one in self.graph and one not in self.matched:
                options += [f'matched:{k}', f'nameless:{k}'] + [f'mix:{k}'] * bool(one.queue)
        if self._endpoints(self.graph) != self.reported:
            options.append('news')
        if any(not one.is_alive for one in self.graph):
            options.append('lease')
        if self.monitor.scene.wants_history('obstacle'):
            options.append('renew')
        if self.mode.frame:
            options.append('transform')
        options += ['switch', 'clock:little', 'clock:back', 'clock:ahead']
        return options if self.mode.is_map else [*options, 'timeout']

    def do(self, event):
        """Let an event happen."""
        what, _, detail = event.partition(':')
        own = self.live(False)
        if what == 'tick':
            for _ in range(int(detail or 1)):
                self._tick()
        elif what == 'list':
            self._plan(own, detail)
            self._send(own)
        elif event == 'send':
            self._send(own)
        elif what == 'send':
            self._send_body(own, detail)
        elif what == 'stamps':
            own.stamps = detail
        elif what in ('kill', 'end'):
            self._stop(own, is_orderly=what == 'end')
        elif what == 'start':
            self.start(detail)
        elif event in ('second:start', 'second:namesake'):
            # A namesake hung for long, and had sent many messages before.
            is_namesake = event == 'second:namesake'
            self.start('a' if is_namesake else 'second', 50 if is_namesake else 0, True)
        elif event == 'second:end':
            self._stop(self.live(True), is_orderly=True)
        elif what == 'second':
            self._send_second(self.live(True), detail)
        elif what == 'get':
            self._deliver(self.publishers[int(detail)], 1)
        elif what == 'all':
            one = self.publishers[int(detail)]
            self._deliver(one, len(one.queue))
        elif what == 'lose':
            self.publishers[int(detail)].queue.pop(0)
        elif what in ('matched', 'nameless'):
            self.publishers[int(detail)].is_named = what == 'matched'
            self._match(self.publishers[int(detail)])
        elif what == 'mix':
            self._mix(self.publishers[int(detail)])
        elif what == 'news':
            self._report(self.graph, is_named=True)
        elif what == 'lease':
            for one in [one for one in self.graph if not one.is_alive]:
                self._leave(one)
        elif what == 'renew':
            self._renew()
        elif what == 'transform':
            self._transform()
        elif what == 'switch':
            self._switch()
        elif what == 'timeout':
            # To one that is too short for this publisher, or back.
            self._change(timeout=1.5 * TIMEOUT / SECOND - self.source.settings.timeout)
        else:
            self._set_clock(detail)

    @property
    def source(self):
        return self.monitor.scene.sources['obstacle']

    @property
    def _may_lose(self):
        """Whether a loss is noticed, or does no harm."""
        return self.mode.has_numbers or self.mode.set_end == EACH_MESSAGE

    def live(self, is_second):
        """Return the publisher that lives, the second one or the other."""
        return next((one for one in self.publishers
                     if one.is_alive and one.is_second is is_second), None)

    def start(self, node, number=0, is_second=False):
        """Start a publisher; messages of a dead one do not arrive after that."""
        for one in self.publishers:
            if not one.is_alive:
                one.queue.clear()
        publisher = Publisher(str(len(self.publishers)), f'/{node}', self.steady, number,
                              is_second)
        self.publishers.append(publisher)
        self.graph.append(publisher)

    # --- time

    def _tick(self):
        self.now += SECOND
        self.steady += SECOND
        own = self.live(False)
        if self.mode.is_refreshed and own is not None and own.sees and (
                self.steady - own.refreshed >= TIMEOUT - 2 * SECOND):
            # A2: what is seen is sent within each timeout.
            self._send_body(own, 'T')
        self._advance()

    def _advance(self):
        self.monitor.advance(self.now)
        self._note_waiting()

    def _set_clock(self, how):
        if how != 'little' and not self.mode.is_map:
            self._drop_waiting()
        last = self.now
        self.now += {'little': -SECOND // 2, 'back': -5 * SECOND, 'ahead': 5 * SECOND}[how]
        if how == 'little' and self.placed_at > self.now:
            # The newest transform is as old as before.
            self.placed_at += self.now - last
        if how != 'little':
            self.epoch += 1
            self.epoch_begun = self.latest = self.now
            self.placed_at = -NEVER
        if how == 'ahead':
            # The steady clock shows it.
            self.monitor.set_clock(self.now)
        self._advance()

    def _switch(self):
        """Disable the source, which drops all that it has received, or enable it."""
        for one in self._delivered():
            one.order = 0
        self._change(enabled=not self.source.settings.enabled)
        self._note_waiting()

    def _change(self, **parameters):
        """Change parameters of the source."""
        self.settings = replace(self.settings, obstacles=(
            replace(self.source.settings, **parameters),))
        self.monitor.update(self.settings)

    def _transform(self):
        """Let a transform of the frame of the bodies come; that of a map is corrected by each."""
        if self.mode.frame == CORRECTED:
            self.corrected = self.corrected is False
            self.monitor.receive_transforms('/tf_static', transforms(
                ('map', 'bodies', self.now, _CORRECTION * self.corrected, 0.0)), self.now)
        else:
            # Behind one that holds from long before.
            begin = (self.now - 500 * SECOND,) if self.placed_at == -NEVER else ()
            for stamp in (*begin, self.now):
                self.monitor.receive_transforms('/tf', transforms(
                    ('map', 'bodies', stamp, 0.0, 0.0)), self.now)
            self.placed_at = max(self.placed_at, self.now)
        self._note_waiting()

    def _note_waiting(self):
        """Note which messages have been placed since, and which news still wait."""
        for one in self._delivered():
            if one.placed_by == NEVER:
                if self.now > one.until:
                    one.until = -NEVER
                elif self._has_place(one):
                    one.placed_by = self.now
        if not self.monitor.waiting.counts():
            self.waits_since.clear()

    def _has_place(self, message):
        if message.body is None or not self.mode.frame:
            return True
        if self.mode.frame == CORRECTED:
            return self.corrected is not None
        return message.stamp <= self.placed_at

    # --- what publishers do

    def _stamp(self, publisher, place=0):
        """Return the stamp of a message, by its place in its listing."""
        style = 'own' if self.own_stamps and not publisher.is_second else publisher.stamps
        last = publisher.sent[-1].stamp if publisher.sent else 0
        if style == 'stand' and 0 <= self.now - last <= STANDS:
            return last
        if self.mode.set_end == NEW_STAMP:
            # One stamp for all of a set, and never that of the one before.
            place = 0
        return self.now + {
            '': 0, 'stand': 0, 'own': 30_000_000 * place, 'ahead': 4 * TOLERANCE // 5,
            'back': -(TOLERANCE // 2 + 30_000_000 * place), 'zero': -self.now,
            'reset': -500 * SECOND}[style]

    def _put(self, publisher, stamp, body, key):
        publisher.number += 1
        is_keyed = self.mode.type == POLYGON_INSTANCE
        message = Message(publisher, publisher.number, stamp, body, key if is_keyed else None)
        message.epoch = self.epoch
        message.is_refused |= len(body or '') > self.max_count
        if body in ('F', 'M'):
            message.place = FAR - SPEED * (body == 'M') * ((stamp or self.now) - START) / SECOND
        publisher.sent.append(message)
        publisher.queue.append(message)

    def _plan(self, publisher, bodies):
        publisher.listing += 1
        is_collection = self.mode.type == POLYGON_COLLECTION
        plan = [bodies] if bodies and is_collection else [*bodies] or [None]
        if bodies and self.mode.set_end == EMPTY_POLYGON:
            plan.append(None)
        stamps = [self._stamp(publisher, place) for place in range(len(plan))]
        if self.mode.set_end == NEW_STAMP:
            # Another one than that of the set before.
            stamps = [stamps[0] + publisher.listing] * len(plan)
        publisher.plan = [*zip(stamps, plan)]

    def _send(self, publisher):
        stamp, body = publisher.plan.pop(0)
        if body is None and self.mode.set_end == EMPTY_POLYGON:
            stamp = self._stamp(publisher)
        # The same ids come in each listing, and twice in one.
        self._put(publisher, stamp, body, publisher.number % 2)
        if not publisher.plan:
            publisher.complete.add(publisher.listing)

    def _send_body(self, own, what):
        body, key = what, 1 if what in 'TRUM' else 2
        if what == 'gone':
            own.sees = False
            return
        if what.startswith('0'):
            body, key = what[1], 0
        if what == 'empty':
            body = None
        if 'T' in what and not key or what == 'T':
            own.sees, own.refreshed = True, self.steady
        self._put(own, self._stamp(own), body, key)

    def _send_second(self, second, body):
        second.listing += 1
        self._put(second, self.now, body, 1)
        if self.mode.set_end == EMPTY_POLYGON:
            self._put(second, self.now, None, 1)
        second.complete.add(second.listing)

    def _stop(self, publisher, is_orderly):
        publisher.is_alive = False
        publisher.plan = []
        if is_orderly:
            self._leave(publisher)

    def _leave(self, publisher):
        # A4: what a publisher sent is taken before the news of its end acts, or never.
        publisher.queue.clear()
        self.graph.remove(publisher)
        if publisher in self.matched:
            self.matched.remove(publisher)

    # --- what the monitor is told

    def _endpoints(self, publishers):
        return [Endpoint(one.gid, one.node if one.is_named else '') for one in publishers]

    def _report(self, publishers, is_named=False):
        """Report the publishers of the topic; those that were not matched are from now on."""
        for one in publishers:
            one.is_named |= is_named
        endpoints = self._endpoints(publishers)
        if self.monitor.waiting.counts():
            self.waits_since.append(self.told)
        self.told = [*publishers]
        self.seen += [one for one in publishers if one not in self.seen]
        self.matched = [one for one in publishers if one in self.graph]
        self.reported = endpoints
        self.monitor.update_publishers('obstacle', endpoints)

    told = ()

    def _match(self, publisher):
        """Let the middleware count a publisher: it is told beside those that were."""
        self._report([*self.told, *(one for one in (publisher,) if one not in self.told)])
        self.monitor.interrupt('obstacle')

    def _mix(self, publisher):
        """Let a publisher be counted while a batch is taken that has messages of it, too."""
        own = next((one for one in self.matched if one.queue), None)
        batch = [one.queue.pop(0) for one in (own, publisher) if one]
        self._match(publisher)
        self._receive(batch, is_mixed=True)

    def _renew(self):
        """Subscribe anew: each publisher sends again what it keeps."""
        self._drop_waiting()
        self.monitor.renew('obstacle')
        for one in self.matched:
            one.is_joined = False
            if one.is_alive:
                one.queue = one.sent[-DEPTH:]

    def _drop_waiting(self):
        """Let what waits not have been received."""
        for one in self._delivered():
            if one.placed_by == NEVER and self._waits(one):
                one.order = 0

    def _deliver(self, publisher, count):
        while count:
            batch = [publisher.queue.pop(0)]
            count -= 1
            while count and publisher.queue[0].number == batch[-1].number + 1:
                batch.append(publisher.queue.pop(0))
                count -= 1
            self._receive(batch)

    def _receive(self, batch, is_mixed=False):
        for one in batch:
            self.deliveries += 1
            # What comes while the source is disabled is not received.
            one.order = self.deliveries * self.source.settings.enabled
            if one.order:
                one.publisher.newest = max(one.publisher.newest, one.number)
            one.publisher.is_joined = True
            one.publisher.is_beside_others |= is_mixed or self.told != [one.publisher]
            one.arrival, one.epoch_in = self.now, self.epoch
            # Those that wait are taken in the order of their arrival.
            self.latest = max(self.latest, self.now)
            one.until = self.latest + TRANSFORM_TIMEOUT
            one.is_refused |= not self.mode.is_map and one.stamp > self.now + TOLERANCE
            one.time = min(one.stamp or self.now, self.now)
            one.placed_by = self.now if self._has_place(one) else NEVER
        data = [bytes_of(one.body, one.stamp, 'bodies' if self.mode.frame else 'map', one.key,
                         self.mode.type == POLYGON_COLLECTION, one.place) for one in batch]
        if is_mixed:
            self.monitor.receive_mixed('obstacle', data, self.now)
        else:
            number = batch[0].number if self.mode.has_numbers else None
            self.monitor.receive_batch('obstacle', data, self.now, number)
        self._note_waiting()

    def _delivered(self):
        return [message for one in self.publishers for message in one.delivered]

    def _waits(self, message):
        """Tell whether a message that was delivered still waits for its transform."""
        return message.placed_by == NEVER and self.now <= message.until
