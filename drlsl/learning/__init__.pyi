from .session import train

__all__ = ["train"]
