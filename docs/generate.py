# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""
Write what the documents take from the code; with --check only report what is out of date.

That is the table of parameters, config/footprint_monitor.yaml, the page of the library, the
picture of the imports in ARCHITECTURE.md, and figures of the benchmarks in README and install.md.
"""

import argparse
import ast
import functools
import json
from pathlib import Path
import sys
import textwrap

from api_page import api_entries
from page_parts import with_part

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from sat_collision.scene.parameters import declare_parameters  # noqa: E402
from sat_collision.scene.settings import DEFAULT_FOOTPRINT, DEFAULT_SOURCE  # noqa: E402

_PLACEHOLDERS = {DEFAULT_FOOTPRINT: '<footprint>', DEFAULT_SOURCE: '<source>'}
_FILE_HEAD = """\
# Every parameter of footprint_monitor with its default; those marked * are fixed at the start,
# those marked + too where lock_parameters is true.
# Written by docs/generate.py from sat_collision/scene/settings.py: copy this file, do not edit it.
/**:
  ros__parameters:
"""


def parameters():
    """Return (name, default, Spec) of every parameter there is by default."""
    found = []

    def declare(name, default, spec):
        found.append((name, default, spec))
        return default

    declare_parameters(declare)
    return found


def parameter_file():
    """Return the parameter file that has all defaults."""
    lines = []
    for name, default, spec in parameters():
        comment = _mark(spec, '', ' ') + spec.description + _allowed(spec, '; {} to {}')
        lines += textwrap.wrap(comment, 99, initial_indent='    # ', subsequent_indent='    # ',
                               break_long_words=False, break_on_hyphens=False)
        lines.append(f'    {name}: {_yaml(default)}')
    return _FILE_HEAD + '\n'.join(lines) + '\n'


def parameter_table():
    """Return the table of the parameters in Markdown."""
    rows = ['| parameter | default | allowed | meaning |', '|---|---|---|---|']
    for name, default, spec in parameters():
        source, dot, field = name.rpartition('.')
        shown = f'{_PLACEHOLDERS[source]}.{field}' if dot else name
        choices = ', '.join(f'`{choice}`' for choice in spec.choices)
        rows.append(f'| `{shown}`{_mark(spec, " ", "")} | `{_yaml(default)}` | '
                    f'{choices or _allowed(spec, "{} to {}")} | {spec.description} |')
    return '\n'.join(rows)


@functools.cache
def imports():
    """
    Return what every module of the package and of the benchmarks imports.

    Returns
    -------
    dict
        Sets of full names by that of the module, such as 'sat_collision.scene.scene'. An import
        `from a import b` is a.b, whether b is a module or not. Those under TYPE_CHECKING are left
        out.

    """
    found = {}
    for path in sorted([*ROOT.glob('sat_collision/**/*.py'), *ROOT.glob('benchmarks/**/*.py')]):
        names = set()
        left = [ast.parse(path.read_text())]
        while left:
            node = left.pop()
            if isinstance(node, ast.Import):
                names.update(alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                names.update(f'{node.module}.{alias.name}' for alias in node.names)
            elif not (isinstance(node, ast.If) and ast.unparse(node.test) == 'TYPE_CHECKING'):
                left += ast.iter_child_nodes(node)
        module = '.'.join(path.relative_to(ROOT).with_suffix('').parts)
        found[module.removesuffix('.__init__')] = names
    return found


def part(name):
    """Return the part of the project that a full name belongs to, such as scene; else None."""
    top, _, rest = name.partition('.')
    first = rest.partition('.')[0]
    if top == 'sat_collision':
        is_part = (ROOT / top / first).is_dir() or (ROOT / top / f'{first}.py').is_file()
        return first if first and is_part else 'sat_collision'
    return top if top == 'benchmarks' else None


def import_picture():
    """
    Return a Mermaid flowchart of which part of the project imports which.

    Where one part imports another by way of a third, too, the direct arrow is left out.
    """
    modules = {}
    arrows = {}
    for module, names in imports().items():
        own = part(module)
        modules.setdefault(own, [])
        if own != 'benchmarks' and module.count('.') == 2:
            modules[own].append(module.rpartition('.')[2])
        arrows.setdefault(own, set()).update(filter(None, map(part, names)))
    lines = ['```mermaid', 'flowchart TB']
    for own, names in modules.items():
        listed = textwrap.wrap(', '.join(names), 26)
        lines.append(f'    {own}["{"<br>".join([f"<b>{own}</b>", *listed])}"]')
    for own in modules:
        others = arrows[own] - {own}
        by_way = set().union(*(arrows[other] - {other} for other in others))
        lines += [f'    {own} --> {other}' for other in sorted(others - by_way)]
    return '\n'.join([*lines, '```'])


def cost_table(loads):
    """Return in Markdown how much processor time a node with shapely takes, times that of ours."""
    loads = [load for load in loads if load['vertices'] == 4]
    return _table(['obstacles, each at 10 Hz', *(f'{load["obstacles"]:,}' for load in loads)], [
        'processor time of shapely in a callback',
        *(f'{load["rival"]["cpu_us"] / load["monitor"]["cpu_us"]:.1f} times ours'
          for load in loads)])


def rate_table(rates):
    """Return in Markdown what share of a core obstacle messages take, with and without numba."""
    rates = [rate for rate in rates if rate['asked_per_second'] == 10_000]
    kernels = {'monitor': 'with numba', 'plain': 'in plain Python'}
    return _table(['', *(kernels[rate['kind']] for rate in rates)], [
        '10,000 obstacle messages a second',
        *(f'{rate["core"]:.0%} of a core' for rate in rates)])


def _table(head, row):
    """Return a table of one row in Markdown."""
    return '\n'.join([f'| {" | ".join(head)} |', '|---' * len(head) + '|',
                      f'| {" | ".join(row)} |'])


def documents():
    """Return the text that each document should have, by path."""
    node = json.loads((ROOT / 'docs' / 'benchmarks' / 'figures.json').read_text())['node']
    found = {ROOT / 'config' / 'footprint_monitor.yaml': parameter_file()}
    for name, mark, part in (
            ('README.md', 'costs', cost_table(node['loads'])),
            ('docs/install.md', 'rates', rate_table(node['rates'])),
            ('docs/api.md', 'names', api_entries()),
            ('docs/parameters.md', 'parameters', parameter_table()),
            ('docs/ARCHITECTURE.md', 'imports', import_picture())):
        path = ROOT / name
        text = found.get(path) or path.read_text()
        found[path] = with_part(text, f'{mark}, written by docs/generate.py', part)
    return found


def _mark(spec, before, behind):
    """Return the mark of a parameter that is fixed at the start, or that can be locked."""
    mark = '*' if not spec.live else '+' if spec.safety else ''
    return f'{before}{mark}{behind}' if mark else ''


def _allowed(spec, form):
    return form.format(*spec.limits) if spec.limits else ''


def _yaml(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f'[{", ".join(map(_yaml, value))}]'
    return "''" if value == '' else str(value)


def main():
    """Write or check the documents; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--check', action='store_true', help='write nothing; 1 if out of date')
    options = parser.parse_args()
    status = 0
    for path, text in documents().items():
        if not path.exists() or path.read_text() != text:
            name = path.relative_to(ROOT)
            if options.check:
                print(f'{name} is out of date: run docs/generate.py')
                status = 1
            else:
                path.write_text(text)
                print(f'{name} updated')
    return status


if __name__ == '__main__':
    sys.exit(main())
