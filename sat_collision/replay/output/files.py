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
"""Files that results are written to: checked before the run, drawn into after it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
import os
from pathlib import Path

from sat_collision.extras import missing
from sat_collision.replay.bag.writer import OutputError
from sat_collision.replay.model.result import Result

_OF_RECORDING = ('.mcap', '.db3', '.zstd', '.db3-wal', '.db3-shm', '.db3-journal')
_PICTURES = ('.png', '.svg', '.pdf')


def check_outputs(files: Mapping[str, str | None], folders: Mapping[str, str | None],
                  inputs: Iterable[str]) -> None:
    """
    Raise what would go wrong when results are written.

    Parameters
    ----------
    files, folders : dict
        Files to write and folders to write into, by option; None where there is none.
    inputs : iterable of str
        Recordings and other files that are read.

    Raises
    ------
    OutputError
        If a path is an input, the output of another option, or cannot be written.

    """
    protected = [file for path in inputs for file in _files_of(Path(path))]
    taken: dict[Path, str] = {}
    for option, text in files.items():
        if text is None:
            continue
        path = Path(text)
        if path.exists() and any(path.samefile(file) for file in protected):
            raise OutputError(f'{option}: {text} is an input, which is not overwritten')
        if path.is_dir():
            raise OutputError(f'{option}: {text} is a directory')
        if not path.parent.is_dir():
            raise OutputError(f'{option}: there is no directory {path.parent}')
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            raise OutputError(f'{option}: {text} cannot be written')
        other = taken.setdefault(path.resolve(), option)
        if other != option and path != Path(os.devnull):
            raise OutputError(f'{other} and {option} name the same file, {text}')
    for option, text in folders.items():
        if text is None:
            continue
        there = next(path for path in (Path(text), *Path(text).absolute().parents)
                     if path.exists())
        if not there.is_dir():
            raise OutputError(f'{option}: {there} is not a directory')
        if not os.access(there, os.W_OK):
            raise OutputError(f'{option}: {there} cannot be written to')


def check_picture(path: str) -> None:
    """
    Raise what is wrong with a file to draw to: its ending says of what kind it is.

    Raises
    ------
    OutputError
        If no picture can have this ending, or what draws it is not installed.

    """
    if is_page(path):
        return
    if Path(path).suffix.lower() not in _PICTURES:
        raise OutputError(f'--plot: {path} should end in .html for a page, or in .png, .svg or '
                          '.pdf for a picture')
    try:
        import matplotlib  # noqa: F401
    except ModuleNotFoundError as error:
        raise OutputError(f'--plot: {missing(error)}') from None


def is_page(path: str) -> bool:
    """Return whether what is drawn into a file is a page."""
    return Path(path).suffix.lower() == '.html'


def draw(results: list[Result], path: str) -> None:
    """Draw results of checks with `keyframes`: a page of all, or a picture of the only one."""
    if is_page(path):
        from sat_collision.replay.output.page import write_page
        write_page(results, path)
    else:
        from sat_collision.replay.output.figure import draw_picture
        result, = results
        draw_picture(result).savefig(path)


def _files_of(path: Path) -> Iterator[Path]:
    """Yield the files that an input consists of."""
    if path.is_dir():
        yield from (file for file in path.iterdir()
                    if file.name == 'metadata.yaml' or file.name.endswith(_OF_RECORDING))
    elif path.exists():
        yield path
