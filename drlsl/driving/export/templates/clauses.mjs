
// The clauses

// decide(scene), and besides for each reason in unsafe_actions the number of the clause that gives it, -1 if none is known.
export function decide_with_clauses(scene) {
  const decision = decide(scene);
  if (decision.unsafe_actions === undefined) return { ...decision, clauses: {} };
  const given = new Map();
  (answer_clauses(facts_of(scene_of(scene))) ?? []).forEach((found, number) => {
    for (const [action, reason] of found) {
      const key = JSON.stringify([action, objection(reason)]);
      if (!given.has(key)) given.set(key, number);
    }
  });
  const number = (action) => (one) => given.get(JSON.stringify([action, one])) ?? -1;
  const clauses = Object.entries(decision.unsafe_actions).map(([action, found]) => [action, found.map(number(action))]);
  return { ...decision, clauses: Object.fromEntries(clauses) };
}
