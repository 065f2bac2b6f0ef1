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

"""What figures were measured on, to be stored with them."""

from importlib import metadata
import os
from pathlib import Path
import platform

from sat_collision import KERNEL


def describe(*packages):
    """Return processor, system and versions, of the named distributions too; no host name."""
    return {
        'processor': _processor(), 'cores': os.cpu_count(),
        'system': f'{platform.system()} {platform.machine()}',
        'python': platform.python_version(), 'kernel': KERNEL,
        **{package: metadata.version(package) for package in packages}}


def _processor():
    """Return the processor's name with its family, model and stepping, which a name may hide."""
    try:
        lines = Path('/proc/cpuinfo').read_text().splitlines()
    except OSError:
        return platform.processor()
    facts = dict(line.replace('\t', '').split(':', 1) for line in reversed(lines) if ':' in line)
    name = facts.get('model name', platform.machine()).strip()
    numbers = [f'{key}{facts[of]}' for key, of in (
        ('family', 'cpu family'), ('model', 'model'), ('stepping', 'stepping')) if of in facts]
    return ', '.join([name, ' '.join(numbers)] if numbers else [name])
