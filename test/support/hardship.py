# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Hard conditions for starting a process: a user without write permission anywhere."""

import ctypes
import os
from pathlib import Path

_DROP_FROM_BOUNDING_SET = 24
_WRITE_ANYWHERE, _READ_ANYWHERE, _CHANGE_ANYWHERE = 1, 2, 3


def without_privileges():
    """Make this process, and the program it becomes, obey file permissions even as root."""
    prctl = ctypes.CDLL(None).prctl
    for capability in (_WRITE_ANYWHERE, _READ_ANYWHERE, _CHANGE_ANYWHERE):
        prctl(_DROP_FROM_BOUNDING_SET, capability)


def forbid_writing(folder):
    """Remove write permission from a folder and everything in it; the owner may delete."""
    for path in (folder, *Path(folder).rglob('*')):
        if not path.is_symlink():
            os.chmod(path, path.stat().st_mode & 0o555)


def allow_writing(folder):
    """Restore write permission of folders, so that they can be deleted."""
    os.chmod(folder, 0o755)
    for path in Path(folder).rglob('*'):
        if path.is_dir():
            os.chmod(path, 0o755)
