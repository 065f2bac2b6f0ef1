# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The entries of docs/api.md, one for each public name of the library, from the docstrings."""

import inspect
import re

import sat_collision

_ORDER = ['intersects', 'intersects_many', 'intersects_pairs', 'separation', 'separations',
          'closest_points', 'contact', 'Contact', 'time_of_contact', 'time_to_contact',
          'first_contact_along', 'PathContact', 'Polygon', 'PolygonSet', 'PolygonError', 'Reason']


def api_entries():
    """Return an entry of each name in Markdown."""
    missing = {*sat_collision.__all__} - {*_ORDER, 'KERNEL'}
    if missing:
        raise ValueError(f'{", ".join(sorted(missing))} must be given a place in the page')
    return '\n'.join(map(_entry, _ORDER)).rstrip()


def _entry(name):
    """Return the entry of a function, or of a class and its methods."""
    thing = getattr(sat_collision, name)
    if not inspect.isclass(thing):
        return f'## {name}\n\n```python\n{name}{_signature(thing)}\n```\n\n{_markdown(thing)}'
    is_result = name in ('Contact', 'PathContact')
    lines = [f'## {"class " if is_result else ""}{name}', '', _markdown(thing)]
    for method, value in vars(thing).items():
        function = getattr(value, 'fget', None) or getattr(value, '__func__', value)
        if method[0] != '_' and inspect.isfunction(function):
            shown = method if isinstance(value, property) else f'{method}{_signature(function)}'
            lines += [f'### `{name}.{shown}`', '', _markdown(function)]
    return '\n'.join(lines)


def _signature(function):
    """Return parameters and result of a function, without the instance or class."""
    signature = inspect.signature(function)
    kept = [one for name, one in signature.parameters.items() if name not in ('self', 'cls')]
    return re.sub(r"'", '', str(signature.replace(parameters=kept)))


def _markdown(thing):
    """Return a numpydoc docstring in Markdown."""
    text = inspect.getdoc(thing)
    body, *sections = re.split(r'^(\w+)\n-+\n', text, flags=re.MULTILINE)
    parts = [body.strip()]
    for title, content in zip(sections[::2], sections[1::2]):
        if title == 'Examples':
            parts.append(f'```python\n{content.strip()}\n```')
        else:
            parts.append(f'**{title}**\n\n' + '\n'.join(map(
                _item, re.split(r'\n(?=\S)', content.strip()))))
    return '\n\n'.join(parts) + '\n'


def _item(text):
    """Return an entry of a section as an item of a list."""
    head, *described = text.splitlines()
    words = ' '.join(line.strip() for line in described)
    return f'- `{head}`' + (f': {words}' if words else '')
