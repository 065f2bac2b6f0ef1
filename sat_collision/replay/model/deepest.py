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

"""The deepest moment of a contact, of recorded motion and as live."""

from sat_collision.geometry.contact import contact as contact_of
from sat_collision.geometry.polygon import Polygon
from sat_collision.replay.model.result import Contact


def deepen(contact: Contact, depth: float, time: int, own: Polygon, other: Polygon) -> bool:
    """
    Update the deepest moment of a contact; return whether this is it.

    Parameters
    ----------
    contact : Contact
    depth : float
        Metres.
    time : int
        In ns.
    own, other : Polygon
        Footprint and obstacle then.

    """
    if contact.deepest and depth <= contact.depth:
        return False
    contact.depth = depth
    contact.deepest = time
    a, b = own.bounds, other.bounds
    contact.x = (max(a[0], b[0]) + min(a[2], b[2])) / 2
    contact.y = (max(a[1], b[1]) + min(a[3], b[3])) / 2
    found = contact_of(own, other)
    contact.normal = found.normal.tolist()
    contact.points = found.points_a.tolist()
    return True
