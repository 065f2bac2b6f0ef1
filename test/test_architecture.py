# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""The structure of the project: imports, lengths of files, generated documents, stable names."""

import ast
import re
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
