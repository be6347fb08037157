"""Make the bundled recordings again, each with its preset's seed and length (needs the extra `sumo`)."""

from __future__ import annotations

from drlsl.traffic import BUNDLED, PRESETS, simulate, write_highd


def main() -> None:
    """Write every preset's recording to its place in the package."""
    for name, preset in PRESETS.items():
        content = simulate(preset, seed=preset.seed, minutes=preset.minutes)
        folder = write_highd(content, BUNDLED / name, force=True, compress=True)
        size = sum(path.stat().st_size for path in folder.iterdir())
        print(f"{name}: {len(content.vehicle_class)} vehicles, {size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
