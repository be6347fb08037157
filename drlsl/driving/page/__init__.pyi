from .page_file import MOST_FRAMES, framed_page, least_thinning, page_text, write_page

__all__ = [
    "MOST_FRAMES",
    "framed_page",
    "least_thinning",
    "page_text",
    "write_page",
]
