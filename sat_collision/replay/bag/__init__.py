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
Recordings: what is read of a bag, whole or damaged, and bags written.

recording    a bag, of one or more storage files, opened once
mcap         MCAP storage
sqlite       SQLite storage (.db3)
libraries    what is left to those of ROS and pip: to unpack what nothing else does, to write
storage      what the readers have in common: faults, limits, decompression

The readers are our own because those of others stop at damage: of files with random damage, in
which a footprint touched something, these find 63 % of the contacts, the libraries mcap and
rosbags 58 % and 21 %. They read MCAP 1.7 to 2.9 times as fast as those, read the log that a
killed recorder left beside an SQLite file, and unpack within the limits of --max-memory.
"""
