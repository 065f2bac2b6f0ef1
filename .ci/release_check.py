# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Say what a release lacks: addresses, or one version everywhere; exit with 1 if there is anything.

The version is that of package.xml, setup.py and the first heading of CHANGELOG.rst.
"""

import ast
from pathlib import Path
import re
import sys
from xml.etree import ElementTree

ADDRESSES = ('website', 'bugtracker', 'repository')


def problems(root):
    """Return what is wrong in the tree at a path, a line each."""
    package = ElementTree.parse(root / 'package.xml').getroot()
    version = package.findtext('version')
    call, = (node for node in ast.walk(ast.parse((root / 'setup.py').read_text()))
             if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == 'setup')
    others = {'setup.py': next(ast.literal_eval(one.value) for one in call.keywords
                               if one.arg == 'version'),
              'CHANGELOG.rst': re.search(r'^(.+)\n-+$', (root / 'CHANGELOG.rst').read_text(),
                                         re.MULTILINE)[1].partition(' (')[0]}
    given = {url.get('type') for url in package.iter('url')}
    return [*(f'{name} has {other}, but package.xml has {version}'
              for name, other in others.items() if other != version),
            *(f'package.xml lacks <url type="{name}">' for name in ADDRESSES
              if name not in given)]


if __name__ == '__main__':
    found = problems(Path(__file__).resolve().parents[1])
    print('\n'.join(found) or 'ready for a release')
    sys.exit(bool(found))
