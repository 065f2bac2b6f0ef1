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


"""The build of the project: who may import whom, how long a file is, and documents that follow."""

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
    'prepare_kernels': {'extras', 'replay', 'geometry'},
}
# The modules that know numba.
COMPILERS = tuple(f'sat_collision.geometry.{name}'
                  for name in ('jit', 'kernel_cache'))
# Parts of other projects that are for some modules only; a module is said by its full name.
RESERVED = {
    'numba': COMPILERS,
    'llvmlite': ('sat_collision.geometry.jit',),
    'rclpy': ('sat_collision.node', 'sat_collision.demo.show'),
    'rclpy.serialization': ('sat_collision.node', 'sat_collision.demo.show',
                            'sat_collision.messages.interfaces'),
    'rosbags': ('sat_collision.messages.rosbags_interfaces', 'sat_collision.replay'),
}
LONGEST = 600
MOST_ARGUMENTS = 7
# Two coordinates a point: a name for each pair would only hide the arithmetic.
POINTS = {'segments_meet': 8}

IMPORTS = imports()
PACKAGE = {module: names for module, names in IMPORTS.items() if part(module) != 'benchmarks'}
BY_MODULE = [(module, name) for module, names in PACKAGE.items() for name in names]
PAGES = [*ROOT.glob('*.md'), *ROOT.glob('docs/**/*.md')]
FILES = sorted((ROOT / 'sat_collision').rglob('*.py'))


def lies_in(name, wider):
    """Tell whether a full name is another one or lies in it."""
    return name == wider or name.startswith(f'{wider}.')


def test_there_is_something_to_check():
    """Every part has modules, and imports are found."""
    assert set(map(part, PACKAGE)) == set(BELOW)
    assert 'sat_collision.scene.scene.Scene' in IMPORTS['sat_collision.monitor']


def test_imports_point_one_way():
    """Down the parts, never up and never between node and replay."""
    leaf = 'sat_collision.replay.output.bag', 'sat_collision.demo.warehouse'
    for module, name in BY_MODULE:
        allowed = {None, part(module)} | BELOW[part(module)]
        assert (module, name) == leaf or part(name) in allowed, f'{module} imports {name}'


def test_no_modules_import_each_other():
    """Not within a part either, by whatever way round."""
    below = {module: {other for other in IMPORTS if other != module and any(
        name == other or name.rpartition('.')[0] == other for name in names)}
        for module, names in PACKAGE.items()}
    while lowest := [module for module, others in below.items() if not others]:
        for module in lowest:
            del below[module]
        for others in below.values():
            others.difference_update(lowest)
    assert not below, f'in a circle: {sorted(below)}'


def test_libraries_are_imported_where_they_belong():
    """ROS in the node, what compiles in jit, the formats of recordings in replay."""
    for module, name in BY_MODULE:
        library = max((library for library in RESERVED if lies_in(name, library)), key=len,
                      default=None)
        assert library is None or any(lies_in(module, home) for home in RESERVED[library]), (
            f'{module} imports {name}')


def test_core_needs_numpy_only():
    """Geometry and scene run wherever NumPy does."""
    for module, name in BY_MODULE:
        if part(module) in ('geometry', 'scene'):
            allowed = {*sys.stdlib_module_names, 'numpy', 'sat_collision',
                       *(('numba', 'llvmlite') if module in COMPILERS else ())}
            assert name.partition('.')[0] in allowed, f'{module} imports {name}'


def test_files_are_read_in_one_sitting():
    """No file of the package is too long, no function takes too much."""
    for path in FILES:
        text = path.read_text()
        assert text.count('\n') <= LONGEST, path
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, (ast.FunctionDef, ast.Lambda)):
                arguments = node.args
                names = [one.arg for one in (*arguments.posonlyargs, *arguments.args,
                                             *arguments.kwonlyargs)]
                taken = [name for name in names if name not in ('self', 'cls')]
                most = POINTS.get(getattr(node, 'name', ''), MOST_ARGUMENTS)
                assert len(taken) <= most, f'{path}:{node.lineno}: {len(taken)} arguments'


@pytest.mark.parametrize('path', documents(), ids=lambda path: path.name)
def test_documents_say_what_the_code_says(path):
    """The parameters, the picture of the imports and the figures; else run `make docs`."""
    assert path.read_text() == documents()[path]


def test_recipe_shows_the_parameters_beside_nav2():
    """As they are in the file that is installed."""
    block = (ROOT / 'docs' / 'recipes.md').read_text().split('```yaml\n')[1]
    assert block.partition('```')[0] == (ROOT / 'config' / 'nav2.yaml').read_text()


@pytest.mark.parametrize('path', PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path):
    """Files are there, and so are the headings within."""
    for target in re.findall(r'\]\(([^)\s]+)\)', path.read_text()):
        name, _, heading = target.partition('#')
        other = (path.parent / name).resolve() if name else path
        if '://' not in target:
            assert other.exists(), target
            assert not heading or heading in headings(other), target


def test_commands_of_make_exist():
    """Each one that a page names has a rule."""
    rules = re.findall(r'^([a-z-][a-z -]*):', (ROOT / 'Makefile').read_text(), re.MULTILINE)
    rules = ' '.join(rules).split()
    for path in PAGES:
        for name in re.findall(r'(?:`|^)make ([a-z-]+)', path.read_text(), re.MULTILINE):
            assert name in rules, f'{path.name}: make {name}'


def headings(path):
    """Return the anchors of a page's headings, as they are on the web."""
    return {re.sub(r'[^a-z0-9_ -]', '', line.lstrip('# ').lower()).replace(' ', '-')
            for line in path.read_text().splitlines() if line.startswith('#')}


def test_example_of_the_readme_gives_what_it_says():
    """Every expression in the Python block has the value in the comment behind it."""
    _, block = (ROOT / 'README.md').read_text().split('```python\n')
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
