// The marks of the episodes that are shown, over time: changes, interventions, contacts.
import type { Drive, Mark, MarkKind } from "./drive";

const ROW = 20;
// The time line begins and ends where the middle of the slider's knob does [pixel].
const INSET = 8;

export const MARKS: Record<MarkKind, [string, string]> = {
  change: ["offered", "lane change"],
  intervention: ["refused", "intervention"],
  contact: ["alarm", "contact, off the road"],
  failure: ["failure", "fail-safe"],
  entry: ["radar", "stretch begins again"],
};

export class Timeline {
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly colours: Record<string, string>,
    seek: (time: number) => void,
  ) {
    const at = (event: PointerEvent): void => {
      const box = canvas.getBoundingClientRect();
      seek(((event.clientX - box.left - INSET) / (box.width - 2 * INSET)) * this.duration);
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      at(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons === 1) at(event);
    });
  }

  private duration = 1;

  draw(drives: Drive[], duration: number, time: number): void {
    this.duration = Math.max(duration, 0.001);
    const { canvas } = this;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth || 600, ROW * drives.length + 4];
    const size: [number, number] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) {
      [canvas.width, canvas.height] = size;
      canvas.style.height = `${height}px`;
    }
    const context = canvas.getContext("2d")!;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    drives.forEach((drive, row) => this.row(context, drive, 2 + row * ROW, width));
    context.fillStyle = this.colours["cursor"]!;
    context.fillRect(INSET + (time / this.duration) * (width - 2 * INSET) - 1, 0, 2, height);
  }

  private row(context: CanvasRenderingContext2D, drive: Drive, top: number, width: number): void {
    const scale = (width - 2 * INSET) / this.duration;
    context.fillStyle = this.colours["track"]!;
    context.fillRect(INSET, top + ROW / 2 - 3, drive.duration * scale, 6);
    const order: MarkKind[] = ["entry", "intervention", "failure", "change", "contact"];
    for (const kind of order) {
      context.fillStyle = this.colours[MARKS[kind][0]]!;
      for (const mark of drive.marks) {
        if (mark.kind === kind) draw(context, kind, INSET + drive.timeOf(mark.frame) * scale, top + ROW / 2);
      }
    }
  }
}

// Each kind has a shape of its own, so that none is told by colour alone.
function draw(context: CanvasRenderingContext2D, kind: MarkKind, x: number, y: number): void {
  if (kind === "intervention" || kind === "entry") {
    const half = kind === "entry" ? 9 : 5;
    context.fillRect(x - 1, y - half, 2, 2 * half);
    return;
  }
  context.beginPath();
  if (kind === "change") context.arc(x, y, 5, 0, 2 * Math.PI);
  else if (kind === "contact") for (const [dx, dy] of [[0, -8], [8, 0], [0, 8], [-8, 0]] as const) context.lineTo(x + dx, y + dy);
  else context.rect(x - 2, y - 6, 4, 12);
  context.fill();
}

export function nextMark(drives: Drive[], time: number, direction: 1 | -1): [number, Drive, Mark] | null {
  let best: [number, Drive, Mark] | null = null;
  for (const drive of drives) {
    for (const mark of drive.marks) {
      const at = drive.timeOf(mark.frame);
      const ahead = direction > 0 ? at > time + 1e-6 : at < time - 1e-6;
      if (ahead && (best === null || (at - best[0]) * direction < 0)) best = [at, drive, mark];
    }
  }
  return best;
}
