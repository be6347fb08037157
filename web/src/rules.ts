// The rules themselves, as drlsl rules export --to js writes them, decide a scene that was changed in the page.
import type { Data, Defaults, Moment, Objection, ProgramData, Scene } from "./data";
import { inflate } from "./drive";

type Found = Omit<Objection, "clause">;

interface Decision {
  safe_actions: string[];
  unsafe_actions?: Record<string, Found[]>;
  clauses?: Record<string, number[]>;
  target_speed: number;
  comfortable_acceleration: number | null;
  observation: number[];
  front_is_free: boolean;
  lane_to_keep: number;
  reasons_undecided?: string;
}

interface Failure {
  undecided?: string;
  failed?: string;
  fail_safe: Decision | null;
}

interface Module {
  decide_with_clauses(scene: Scene): Decision | Failure;
}

export class Rules {
  private constructor(private readonly module: Module, readonly program: ProgramData, private readonly data: Data) {}

  static async load(program: ProgramData, data: Data): Promise<Rules> {
    const text = await inflate(program.module ?? "");
    const address = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
    try {
      return new Rules((await import(address)) as Module, program, data);
    } finally {
      URL.revokeObjectURL(address);
    }
  }

  get defaults(): Defaults {
    return this.data.defaults;
  }

  // What the rules say about a scene; where they cannot say anything, the fail-safe.
  decide(scene: Scene): Moment {
    const answer = this.module.decide_with_clauses(scene);
    const failed = "fail_safe" in answer;
    const decision = failed ? answer.fail_safe : answer;
    const failure = failed ? (answer.failed ?? answer.undecided ?? "no decision") : "";
    return {
      scene,
      offered: this.data.actions.map((action) => decision?.safe_actions.includes(action) ?? false),
      objections: this.data.actions.map((action) => this.objections(decision, action)),
      targetSpeed: decision?.target_speed ?? NaN,
      comfort: decision?.comfortable_acceleration ?? null,
      observation: decision?.observation ?? [],
      laneToKeep: decision?.lane_to_keep ?? 0,
      frontIsFree: decision?.front_is_free ?? false,
      distance: null,
      action: -1,
      preferences: null,
      failure,
    };
  }

  // Why a scene cannot be read; null if it can.
  problemOf(scene: Scene): string | null {
    const answer = this.module.decide_with_clauses(scene);
    return "fail_safe" in answer && answer.fail_safe === null ? (answer.failed ?? "it cannot be read") : null;
  }

  private objections(decision: Decision | null, action: string): Objection[] {
    const undecided = decision?.reasons_undecided;
    const refused = decision !== null && !decision.safe_actions.includes(action);
    if (undecided !== undefined && refused) return [{ reason: `no reason: ${undecided}`, clause: -1 }];
    const found = decision?.unsafe_actions?.[action] ?? [];
    return found.map((one, n) => ({ ...one, clause: decision?.clauses?.[action]?.[n] ?? -1 }));
  }
}
