from .page_file import MOST_FRAMES, least_thinning, write_page

__all__ = [
    "MOST_FRAMES",
    "least_thinning",
    "write_page",
]
