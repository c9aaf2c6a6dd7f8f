"""Work spread over processes, each result kept at once, so that an interrupted run goes on."""

import hashlib
import json
import multiprocessing
import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lfd_diagnosis
import lfd_mpc
import lfd_observer
import lfd_replay
from lfd_mpc.errors import UserError

SCHEDULER_DEADLINE = 10.0
"""Seconds within which a Dask scheduler must answer."""


@dataclass(frozen=True)
class Task:
    """A call whose result can be written as JSON; `key` names it and all that it depends on."""

    key: str
    function: Callable[..., Any]
    arguments: tuple


RunAll = Callable[[list[Task]], dict[str, Any]]
"""Runs tasks; gives their results by key, in the order of the tasks."""


def fingerprint(recorded: Path | None) -> str:
    """A checksum of the code, and of the folder of recorded drives, that results come from."""
    digest = hashlib.sha256()
    for file in sorted(recorded.glob("*.csv")) if recorded else ():
        digest.update(f"{file.name}\0".encode() + file.read_bytes())
    for package in (lfd_mpc, lfd_observer, lfd_diagnosis, lfd_replay):
        folder = Path(package.__file__).parent
        for file in sorted((*folder.rglob("*.py"), *folder.rglob("*.dbc"))):
            digest.update(f"{file.relative_to(folder)}\0".encode() + file.read_bytes())
    return digest.hexdigest()


class Journal:
    """Results by key in a file of JSON lines; those of other code do not count."""

    def __init__(self, path: Path, recorded: Path | None = None) -> None:
        """Raises UserError, as `add` does, where nothing can be written."""
        self._path = path
        self.results: dict[str, Any] = {}
        head = json.dumps({"code": fingerprint(recorded)})
        # As bytes: a line that is damaged costs its own result, and no other.
        lines = path.read_bytes().splitlines() if path.is_file() else []
        if lines[:1] == [head.encode()]:
            for line in lines[1:]:
                try:
                    entry = json.loads(line)
                    self.results[entry["key"]] = entry["result"]
                except (ValueError, TypeError, KeyError):
                    continue  # the line at which a run was cut off, or a disk lost something
        else:
            self._write("w", head + "\n")

    def add(self, key: str, result: Any) -> None:
        """Keep one result."""
        self._write("a", "\n" + json.dumps({"key": key, "result": result}))
        # As it will be read the next time, so that a resumed run gives the same.
        self.results[key] = json.loads(json.dumps(result))

    def _write(self, mode: str, text: str) -> None:
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._path.open(mode) as file:
                file.write(text)
        except OSError as error:
            raise UserError(
                f"{self._path}: results cannot be kept there ({error.strerror})"
            ) from error


def _end_with_parent() -> None:
    # A parent that is killed tells nobody, and a worker would wait for its next task for ever.
    def watch() -> None:
        multiprocessing.parent_process().join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def workers(jobs: int, scheduler: str | None = None) -> Iterator[Executor]:
    """Processes of this machine, or those behind a Dask scheduler at an address.

    Raises UserError where Dask is not installed or nothing answers at the address.
    """
    if scheduler is None:
        # Started afresh, so that a worker holds nothing of the parent's threads.
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(jobs, context, _end_with_parent) as pool:
            yield pool
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise UserError(
            "--scheduler needs Dask: pip install -r requirements-dask.txt into the environment"
        ) from error
    try:
        client = Client(scheduler, timeout=SCHEDULER_DEADLINE)
    except (OSError, ValueError) as error:
        raise UserError(f"--scheduler {scheduler}: no Dask scheduler answers there") from error
    with client, client.get_executor(pure=False) as pool:
        yield pool


def run_tasks(
    tasks: Iterable[Task], journal: Journal, pool: Executor, done: Callable[[], None]
) -> dict[str, Any]:
    """Results by key of all tasks; `done` is called after each one.

    Raises what a task raised; results until then are kept.
    """
    tasks = list(tasks)
    waiting = {}
    for task in tasks:
        if task.key in journal.results:
            done()
        else:
            waiting[pool.submit(task.function, *task.arguments)] = task.key
    try:
        while waiting:
            finished, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in finished:
                journal.add(waiting.pop(future), future.result())
                done()
    finally:
        for future in waiting:
            future.cancel()
    return {task.key: journal.results[task.key] for task in tasks}
