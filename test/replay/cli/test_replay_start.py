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

"""How the command starts: whatever fails is no verdict, and what it shows suits who reads it."""

import os
from pathlib import Path
import pty
import re
import subprocess
import sys

import pytest
from recordings import drive, write

ROOT = Path(__file__).resolve().parents[3]
# The command, in a process where a module cannot be imported.
WITHOUT = """
import sys
for name in {names!r}:
    sys.modules[name] = None
from sat_collision.replay.__main__ import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture
def bags(tmp_path):
    """Return a clear recording and one with a contact."""
    return (str(write(tmp_path / 'clear', drive(2.0, contact=(0, 0)))),
            str(write(tmp_path / 'touching', drive(2.0, contact=(1.0, 1.5)))))


def run(*arguments, program=('-m', 'sat_collision.replay'), **environment):
    """Run the command in a process of its own."""
    return subprocess.run([sys.executable, *program, *arguments], capture_output=True, text=True,
                          env={**os.environ, **environment}, cwd=ROOT)


@pytest.mark.parametrize('missing', ('yaml', 'numpy', 'sat_collision.replay.run'))
def test_import_that_fails_is_bad_input(bags, missing):
    """Exit status 3 and one line; 1 would say that something touched."""
    program = '-c', WITHOUT.format(names=[missing])
    result = run(bags[0], program=program)
    assert (result.returncode, result.stdout) == (3, '')
    line, = result.stderr.splitlines()
    assert line.startswith(f'replay_check: cannot start: {missing} is not installed')
    assert ('pip install pyyaml' in line) is (missing == 'yaml')
    result = run(bags[0], '--debug', program=program)
    assert result.returncode == 3 and 'Traceback' in result.stderr


def test_installed_command_starts_where_the_module_does():
    """The script that setup.py makes calls what keeps crashes apart from collisions."""
    assert "'replay_check = sat_collision.replay.__main__:main'" in (ROOT / 'setup.py').read_text()


def test_help_and_completion_come_without_the_kernels():
    """They import neither NumPy nor numba."""
    program = '-c', WITHOUT.format(names=['numba', 'numpy'])
    assert 'BAG' in run('--help', program=program).stdout


def test_shell_completes_options_and_their_values(tmp_path):
    """By argcomplete, as the shell asks it to."""
    pytest.importorskip('argcomplete')
    found = []
    for line in ('replay_check --clo', 'replay_check --clock '):
        answer = tmp_path / 'answer'
        run(_ARGCOMPLETE='1', _ARGCOMPLETE_SHELL='bash', _ARGCOMPLETE_IFS='|', COMP_LINE=line,
            COMP_POINT=str(len(line)), COMP_TYPE='9', _ARGCOMPLETE_STDOUT_FILENAME=str(answer))
        found.append(answer.read_text().strip().split('|'))
    assert [name.strip() for name in found[0]] == ['--clock']
    assert set(found[1]) == {'receive', 'header'}


def on_terminal(*arguments, **environment):
    """Return what the command prints on a terminal."""
    master, slave = pty.openpty()
    with os.fdopen(slave, 'w') as terminal:
        process = subprocess.Popen(
            [sys.executable, '-m', 'sat_collision.replay', *arguments], stdout=terminal,
            stderr=subprocess.PIPE, text=True, env={**os.environ, 'TERM': 'xterm', **environment})
    shown = b''
    while True:
        try:
            part = os.read(master, 4096)
        except OSError:  # how the end of a terminal reads
            break
        shown += part
    os.close(master)
    assert process.stderr.read() == '' and process.wait(60) == 1
    process.stderr.close()
    return shown.decode()


def test_verdicts_have_colours_on_a_terminal_only(bags):
    """And never where NO_COLOR is set, or the terminal has none."""
    shown = on_terminal(*bags, NO_COLOR='')
    assert re.search(r'clear: \033\[1;32mCLEAR\033\[0m', shown)
    assert shown.count('\033[1;31mCOLLISION\033[0m') == 2, 'of the recording and of both'
    for plain in (on_terminal(*bags, NO_COLOR='1'), on_terminal(*bags, TERM='dumb'),
                  run(*bags).stdout):
        assert '\033' not in plain and 'touching: COLLISION' in plain
