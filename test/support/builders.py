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

"""Serialised messages, as publishers send them."""

import struct

SECOND = 10**9


def serialised(points, stamp=1000 * SECOND, frame_id='map', instance=None):
    """Write a polygon message as a little-endian publisher does."""
    text = frame_id.encode() + b'\0'
    body = struct.pack('<iII', *divmod(stamp, SECOND), len(text)) + text
    body += bytes(-len(body) % 4) + struct.pack('<I', len(points))
    body += b''.join(struct.pack('<fff', x, y, 0) for x, y in points)
    if instance is not None:
        body += bytes(-len(body) % 8) + struct.pack('<q', instance)
    return b'\0\1\0\0' + body
