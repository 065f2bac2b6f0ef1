# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The pages of docs for rosdoc2, which copies them to the root of its own tree.

It copies README.md and others of the root to standard_docs/original. Links lead to where a page
is then; those to what is not a page become plain text. The library has its page, api.md, so
modules are not described one by one.
"""

from posixpath import dirname, join, normpath
import re

from pygments.lexers import TextLexer

_ORIGINAL = 'standard_docs/original/'

rosdoc2_settings = {'enable_autodoc': False}
exclude_patterns = [
    'standards.rst', 'modules.rst', 'sat_collision*.rst', '__readme_include.rst',
    *(f'standard_docs/{name}.rst' for name in (
        'CONTRIBUTING', 'LICENSE', 'PACKAGE', 'QUALITY_DECLARATION', 'README'))]
myst_heading_anchors = 4


def setup(app):
    """Rewrite the links of each page as it is read."""
    def rewrite(app, page, source):
        source[0] = re.sub(r'\[([^]]*)\]\(([^):]+)\)', lambda link: _link(page, *link.groups()),
                           source[0])

    app.connect('source-read', rewrite)
    app.add_lexer('mermaid', TextLexer)


def _link(page, text, target):
    """Return a link of a page, in Markdown, or its text."""
    name, _, heading = target.partition('#')
    if not name:
        return f'[{text}]({target})'
    is_original = page.startswith(_ORIGINAL)
    path = normpath(join('' if is_original else join('docs', dirname(page)), name))
    if path.startswith('docs/'):
        place = path.removeprefix('docs/')
    elif path in ('README.md', 'CONTRIBUTING.md', 'QUALITY_DECLARATION.md'):
        place = _ORIGINAL + path
    else:
        return text
    return f'[{text}](/{place}{"#" + heading if heading else ""})'
