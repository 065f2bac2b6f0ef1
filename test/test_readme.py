# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The Python example of README, with whatever package is imported."""

from pathlib import Path

README = Path(__file__).resolve().parents[1] / 'README.md'


def test_readme_example():
    """Every expression in the Python block has the value in the comment after it."""
    _, block = README.read_text().split('```python\n')
    known = {}
    checked = 0
    for line in block.partition('```')[0].splitlines():
        code, _, comment = map(str.strip, line.partition('  # '))
        if comment:
            assert comment.startswith(repr(eval(code, known))), line
            checked += 1
        else:
            exec(code, known)
    assert checked == 6
