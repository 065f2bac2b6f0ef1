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

"""What metadata.yaml announces of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from sat_collision.replay.bag.unpacking import Damage, in_words
import yaml

# Transient local, in the words and numbers of rosbag2.
_LATCHED = 'transient_local', 1


class Metadata(NamedTuple):
    """
    What is announced.

    Attributes
    ----------
    files : list of str
        Names of the storage files, in their order.
    counts : dict
        Numbers of messages by topic.
    total : int
        Number of messages in all.
    latched : set of str
        Topics whose publishers were transient local.
    packed : bool
        Files or messages are compressed one by one.

    """

    files: list[str]
    counts: dict[str, int]
    total: int
    latched: set[str]
    packed: bool


def read_metadata(path: Path, most: int) -> Metadata:
    """
    Read metadata.yaml, of at most so many bytes.

    Raises
    ------
    Damage
        If it is not what a recorder writes.

    """
    if path.stat().st_size > most:
        raise Damage(f'more than {most} bytes')
    try:
        content = yaml.load(path.read_text(encoding='utf-8'), yaml.SafeLoader)
    except Exception as error:  # whatever the constructors of YAML's types raise
        raise Damage(f'is no YAML: {in_words(error)}') from error
    information = _entry(content, 'rosbag2_bagfile_information', dict)
    files = [Path(_checked(name, str, 'relative_file_paths')).name
             for name in _entry(information, 'relative_file_paths', list)]
    counts: dict[str, int] = {}
    latched = set()
    for topic in _entry(information, 'topics_with_message_count', list):
        described = _entry(topic, 'topic_metadata', dict)
        name = _entry(described, 'name', str)
        counts[name] = counts.get(name, 0) + _entry(topic, 'message_count', int)
        if _is_latched(described.get('offered_qos_profiles')):
            latched.add(name)
    return Metadata(files, counts, _entry(information, 'message_count', int), latched,
                    bool(information.get('compression_mode')))


def _is_latched(profiles: Any) -> bool:
    """Return whether one of the profiles, a list or the YAML text of one, has it."""
    if isinstance(profiles, str):
        try:
            profiles = yaml.load(profiles, yaml.SafeLoader)
        except Exception:  # as in read_metadata
            return False
    return isinstance(profiles, list) and any(
        isinstance(profile, dict) and profile.get('durability') in _LATCHED
        for profile in profiles)


def _entry(content: Any, key: str, kind: type) -> Any:
    if not isinstance(content, dict) or key not in content:
        raise Damage(f"has no '{key}' where it belongs")
    return _checked(content[key], kind, key)


def _checked(value: Any, kind: type, key: str) -> Any:
    if type(value) is not kind:
        raise Damage(f"'{key}' is not of the right type")
    return value
