# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What a publisher means, and the messages that it sends, in a world around one source.

A body is 'T', which touches the footprint, 'F', which is far, 'M', which is far and comes nearer,
None for an empty polygon, 'R' for one that is refused, or 'U' for bytes that cannot be read.
"""

from functools import cache
from typing import NamedTuple

from builders import box, collection, serialised
from sat_collision.scene.settings import (
    EACH_MESSAGE, EMPTY_POLYGON, NEVER, NEW_STAMP, NONE, POLYGON, POLYGON_COLLECTION,
    POLYGON_INSTANCE)

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
