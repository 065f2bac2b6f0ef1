# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""The structure and style of the project: imports, lengths, documents, names, the licence."""

import ast
import hashlib
import importlib
from pathlib import Path
import re
import subprocess
import sys

from generate import documents, imports, part, ROOT
import pytest

# Each part, and the parts that it may import from.
BELOW = {
    'extras': set(),
    'geometry': set(),
    'sat_collision': {'geometry'},
    'scene': {'geometry'},
    'messages': {'scene', 'geometry'},
    'monitor': {'messages', 'scene', 'geometry'},
    'node': {'extras', 'sat_collision', 'monitor', 'messages', 'scene', 'geometry'},
    'replay': {'extras', 'sat_collision', 'monitor', 'messages', 'scene', 'geometry'},
    'demo': {'extras', 'geometry'},
}
# The folders of geometry, each on those before it; what is in none of them may import all.
FLOORS = 'compiled', 'numeric', 'body', 'pair', 'motion', 'sets'
# The modules that may import numba.
COMPILERS = tuple(f'sat_collision.geometry.compiled.{name}' for name in ('jit', 'kernel_cache'))
# Libraries that only some modules may import, by full name.
RESERVED = {
    'numba': COMPILERS,
    'llvmlite': ('sat_collision.geometry.compiled.jit',),
    'rclpy': ('sat_collision.node', 'sat_collision.demo.show', 'sat_collision.demo.publish'),
    'rclpy.serialization': ('sat_collision.node', 'sat_collision.demo.show',
                            'sat_collision.messages.interfaces'),
    'rosbags': ('sat_collision.messages.rosbags_interfaces', 'sat_collision.replay'),
}
MAX_LINES = 600
MAX_ARGUMENTS = 7
# Kernels that take the two coordinates of each point.
POINTS = {'segments_meet': 8}

PAGES = [*ROOT.glob('*.md'), *ROOT.glob('docs/**/*.md')]
FILES = sorted((ROOT / 'sat_collision').rglob('*.py'))


def package():
    """Return the names that each module of the package imports."""
    return {module: names for module, names in imports().items() if part(module) != 'benchmarks'}


def by_module():
    """Return them as pairs of module and name."""
    return [(module, name) for module, names in package().items() for name in names]


def is_within(name, wider):
    """Tell whether a full name is another one or lies within it."""
    return name == wider or name.startswith(f'{wider}.')


def test_all_parts_and_their_imports_are_found():
    assert set(map(part, package())) == set(BELOW)
    assert 'sat_collision.scene.scene.Scene' in imports()['sat_collision.monitor']


def test_imports_point_one_way():
    """Down the parts, never up, and never between node and replay."""
    leaf = 'sat_collision.replay.output.bag', 'sat_collision.demo.warehouse'
    for module, name in by_module():
        allowed = {None, part(module)} | BELOW[part(module)]
        assert (module, name) == leaf or part(name) in allowed, f'{module} imports {name}'


def test_folders_of_geometry_stand_on_those_before():
    prefix = 'sat_collision.geometry.'
    for module, name in by_module():
        own, other = (one.removeprefix(prefix).partition('.')[0] for one in (module, name))
        if module.startswith(prefix) and name.startswith(prefix) and own in FLOORS:
            assert other in FLOORS[:FLOORS.index(own) + 1], f'{module} imports {name}'


def test_imports_have_no_cycles():
    """Within a part, either."""
    below = {module: {other for other in imports() if other != module and any(
        name == other or name.rpartition('.')[0] == other for name in names)}
        for module, names in package().items()}
    while lowest := [module for module, others in below.items() if not others]:
        for module in lowest:
            del below[module]
        for others in below.values():
            others.difference_update(lowest)
    assert not below, f'in a cycle: {sorted(below)}'


def test_libraries_are_imported_where_they_belong():
    """ROS in the node, compilers in geometry, recording formats in replay."""
    for module, name in by_module():
        library = max((library for library in RESERVED if is_within(name, library)), key=len,
                      default=None)
        assert library is None or any(is_within(module, home) for home in RESERVED[library]), (
            f'{module} imports {name}')


def test_core_needs_numpy_only():
    for module, name in by_module():
        if part(module) in ('geometry', 'scene'):
            allowed = {*sys.stdlib_module_names, 'numpy', 'sat_collision',
                       *(('numba', 'llvmlite') if module in COMPILERS else ())}
            assert name.partition('.')[0] in allowed, f'{module} imports {name}'


def test_files_and_argument_lists_are_short():
    for path in FILES:
        text = path.read_text()
        assert text.count('\n') <= MAX_LINES, path
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, (ast.FunctionDef, ast.Lambda)):
                arguments = node.args
                names = [one.arg for one in (*arguments.posonlyargs, *arguments.args,
                                             *arguments.kwonlyargs)]
                taken = [name for name in names if name not in ('self', 'cls')]
                limit = POINTS.get(getattr(node, 'name', ''), MAX_ARGUMENTS)
                assert len(taken) <= limit, f'{path}:{node.lineno}: {len(taken)} arguments'


def test_names_in_pictures_of_the_ways_are_files():
    text = (ROOT / 'docs' / 'ARCHITECTURE.md').read_text()
    pictures = re.findall(r'^## The way .*?```mermaid\n(.*?)```', text, re.DOTALL | re.MULTILINE)
    names = re.findall(r'[\w/]+\.py', ' '.join(pictures))
    assert len(pictures) == 2
    assert all((ROOT / 'sat_collision' / name).is_file() for name in names)


def test_generated_documents_are_up_to_date():
    """If this fails, run `make docs`."""
    found = documents()
    assert len(found) == 6
    for path, text in found.items():
        assert path.read_text() == text, path.name


def test_stable_surface_is_as_stored():
    """Whether names, types, defaults, limits or signatures have changed."""
    pytest.importorskip('rosbags')
    from surface import STORED, surface
    stored, found = STORED.read_text().splitlines(), surface()
    gone = [line for line in stored if line not in found]
    new = [line for line in found if line not in stored]
    assert not (gone or new), '\n'.join([
        'what docs/stability.md promises has changed. A line that is gone, or has another type,',
        'default, limit or signature, needs a major version; a new one a minor version. Both need',
        'a line in CHANGELOG.rst. If it is meant, make surface writes test/surface.txt anew.',
        *(f'- {line}' for line in gone), *(f'+ {line}' for line in new)])


def test_recipe_shows_the_shipped_nav2_parameters():
    block = (ROOT / 'docs' / 'recipes.md').read_text().split('```yaml\n')[1]
    assert block.partition('```')[0] == (ROOT / 'config' / 'nav2.yaml').read_text()


@pytest.mark.parametrize('path', PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links(path):
    """Files and headings exist."""
    for target in re.findall(r'\]\(([^)\s]+)\)', path.read_text()):
        name, _, heading = target.partition('#')
        other = (path.parent / name).resolve() if name else path
        if '://' not in target:
            assert other.exists(), target
            assert not heading or heading in headings(other), target


def test_tests_that_pages_name_exist():
    """In the file that the link leads to; and each threat has one, or is said to be open."""
    for path in PAGES:
        for name, file in re.findall(r'\[`(test_\w+)`\]\((\S+)\)', path.read_text()):
            assert f'\ndef {name}(' in (path.parent / file).read_text(), f'{path.name}: {name}'
    for line in (ROOT / 'SECURITY.md').read_text().splitlines():
        if line.startswith('| ') and not line.endswith('| shown by |'):
            assert '[`test_' in line or '**open**' in line, line


def test_make_commands_exist():
    """Each one that a page names has a rule."""
    rules = re.findall(r'^([a-z-][a-z -]*):', (ROOT / 'Makefile').read_text(), re.MULTILINE)
    rules = ' '.join(rules).split()
    for path in PAGES:
        for name in re.findall(r'(?:`|^)make ([a-z-]+)', path.read_text(), re.MULTILINE):
            assert name in rules, f'{path.name}: make {name}'


def headings(path):
    """Return the anchors of a page's headings, as GitHub forms them."""
    return {re.sub(r'[^a-z0-9_ -]', '', line.lstrip('# ').lower()).replace(' ', '-')
            for line in path.read_text().splitlines() if line.startswith('#')}


# --- style and licence


FOLDERS = ('sat_collision', 'test', 'benchmarks', 'docs', 'examples', 'launch')
SOURCES = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob('*.py'))]
BUILT = ('.venv', 'build', 'install', 'log')


def ament(name):
    """Return the main module of an ament linter, None if it is not installed."""
    try:
        return importlib.import_module(f'{name}.main')
    except ImportError:
        return None


@pytest.mark.linter
def test_style(monkeypatch, cache):
    """
    Flake8 as ament_flake8 runs it; otherwise with the same rules from setup.cfg.

    A file is not read again until it, the rules or flake8 change.
    """
    monkeypatch.chdir(ROOT)
    if linter := ament('ament_flake8'):
        status, errors = linter.main_with_errors(argv=['--exclude', *BUILT])
        assert status == 0, '\n'.join(errors)
    else:
        pytest.importorskip('flake8')
        flake8 = [sys.executable, '-m', 'flake8', '--config', 'setup.cfg']
        rules = subprocess.check_output([*flake8, '--version']) + Path('setup.cfg').read_bytes()
        right = {str(path): hashlib.sha256(rules + path.read_bytes()).hexdigest()
                 for path in Path().rglob('*.py') if path.parts[0] not in BUILT}
        before = cache.get('style/right', {})
        changed = [path for path, digest in right.items() if before.get(path) != digest]
        # Without a name, flake8 would read all.
        result = subprocess.run([*flake8, 'setup.py', *changed], capture_output=True, text=True)
        assert result.returncode == 0, result.stdout + result.stderr
        cache.set('style/right', right)


@pytest.mark.linter
def test_docstrings(monkeypatch, capfd):
    """
    PEP 257 as ament_pep257 checks it; without that it is part of the style.

    Except for D401, which takes properties for functions, and D417, which overlooks parameters
    that numpydoc describes together or by type alone.
    """
    monkeypatch.chdir(ROOT)
    linter = ament('ament_pep257') or pytest.skip('apt install ros-jazzy-ament-pep257')
    status = linter.main(argv=['--add-ignore', 'D401', 'D417', '--', 'setup.py', *FOLDERS])
    assert status == 0, capfd.readouterr()


@pytest.mark.linter
def test_licence_of_the_package(monkeypatch, capfd):
    """As ament_copyright reads LICENSE, CONTRIBUTING.md and every source."""
    monkeypatch.chdir(ROOT)
    linter = ament('ament_copyright') or pytest.skip('apt install ros-jazzy-ament-copyright')
    assert linter.main(argv=['--exclude', *BUILT, '--', '.']) == 0, capfd.readouterr()


@pytest.mark.linter
def test_sources_carry_the_licence():
    """Every source file begins with the copyright and the Apache-2.0 notice."""
    notice = re.compile(r'# Copyright \d+ The sat_collision Authors\n#\n'
                        r'# Licensed under the Apache License, Version 2\.0')
    assert SOURCES and not [path for path in SOURCES if not notice.match(path.read_text())]
