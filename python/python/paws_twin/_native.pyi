from collections.abc import Callable, Sequence

__version__: str

def call(
    args: Sequence[str], progress: Callable[[str, int, int], object] | None = None
) -> tuple[int, str, str, str | None]: ...
def main(args: Sequence[str]) -> int: ...
