"""Work in parts, here or through any ``concurrent.futures.Executor``, of which nothing but ``submit`` is used.

``map`` of dask's executor refuses iterators; ``submit`` all of them have: threads, processes, joblib's, dask's. The parts
and their order are the same wherever they are computed, and so are the numbers.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from typing import Any, NamedTuple

# Parts under way at once: enough for the workers of a cluster, few enough to be held.
UNDER_WAY = 128

Progress = Callable[[int, int], object]


class Done(NamedTuple):
    """Result of a part by its place; or the error on its way there and back, such as that of a worker that died."""

    place: int
    result: Any
    error: BaseException | None = None


def completed(
    function: Callable[..., Any],
    parts: Sequence[tuple[Any, ...]],
    executor: Executor | None,
    progress: Progress | None = None,
    sizes: Sequence[int] = (),
) -> Iterator[Done]:
    """``function(*part)`` of each part, in order; with ``progress(done, all)`` of the sizes.

    What `function` itself raises comes as an error too, except KeyboardInterrupt, after which nothing more is begun.
    """
    sizes = sizes or [1] * len(parts)
    total, so_far = sum(sizes), 0
    for done in _here(function, parts) if executor is None else _elsewhere(function, parts, executor):
        so_far += sizes[done.place]
        if progress is not None:
            progress(so_far, total)
        yield done


def _here(function: Callable[..., Any], parts: Sequence[tuple[Any, ...]]) -> Iterator[Done]:
    for place, part in enumerate(parts):
        try:
            done = Done(place, function(*part))
        except Exception as error:
            done = Done(place, None, error)
        yield done


def _elsewhere(function: Callable[..., Any], parts: Sequence[tuple[Any, ...]], executor: Executor) -> Iterator[Done]:
    waiting: deque[Any] = deque()
    begun = 0
    try:
        for place in range(len(parts)):
            while begun < len(parts) and len(waiting) < UNDER_WAY:
                waiting.append(_submitted(executor, function, parts[begun]))
                begun += 1
            future = waiting.popleft()
            if isinstance(future, Exception):
                yield Done(place, None, future)
                continue
            try:
                done = Done(place, future.result())
            except Exception as error:
                done = Done(place, None, error)
            yield done
    finally:
        for future in waiting:
            if not isinstance(future, Exception):
                future.cancel()


def _submitted(executor: Executor, function: Callable[..., Any], part: tuple[Any, ...]) -> Any:
    """A future, or the error of an executor that takes no more work."""
    try:
        return executor.submit(function, *part)
    except Exception as error:
        return error
