from .page_file import MOST_FRAMES, write_page

__all__ = [
    "MOST_FRAMES",
    "write_page",
]
