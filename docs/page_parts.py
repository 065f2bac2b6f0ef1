# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""Parts of pages that programs write: between `<!-- name -->` and `<!-- until here -->`."""

import re

_MARK = re.compile(r'<!-- ([\w -]+) -->\n(?=.*?<!-- until here -->)', re.DOTALL)


def with_part(text, name, part):
    """
    Return the text of a page with a part replaced.

    Parameters
    ----------
    text : str
    name : str
    part : str
        The new text, without the line break at its end.

    Raises
    ------
    ValueError
        The page lacks one of the two lines.

    """
    mark, until = f'<!-- {name} -->\n', '<!-- until here -->\n'
    head, begun, rest = text.partition(mark)
    _, ended, tail = rest.partition(until)
    if not (begun and ended):
        raise ValueError(f'{mark.strip()} and {until.strip()} must enclose what is written')
    return f'{head}{mark}{part}\n{until}{tail}'


def replace_part(path, name, part):
    """Replace a part of the page at a `pathlib.Path`, see `with_part`."""
    path.write_text(with_part(path.read_text(), name, part))


def with_tables(page, tables, figures):
    """Return the text of a page with each part replaced by the table that `tables` makes of it."""
    for name in _MARK.findall(page):
        if name != 'until here':
            page = with_part(page, name, tables[name](figures))
    return page
