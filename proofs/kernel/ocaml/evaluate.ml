(* `robust-kernel --evaluate FILE`: what the specification says of single schedules. Behind the plan stand schedules, each with the
   values of all parameters and the times of all time points; for each a line is printed, with t for what is so and f for what is not:
   whether the network allows it, whether it is valid, then in the plan's order each constraint, mutex pair, obligation and agreement.
   All of it has been proved to be what Spec.v says; trusted are text.ml and this printing. *)
open Kernel

let flag b = if b then "t" else "f"
let flags l = "(" ^ String.concat " " (List.map flag l) ^ ")"
let pair (p, q) apart = Printf.sprintf "(%d %d %s)" p q (flag apart)

let line { Pddl.plan; epsilon; _ } = function
  | Text.List [ values; times ] ->
      let r = evaluated plan (Text.list Text.rational values) (Text.list Text.rational times) epsilon in
      if not (is_right r) then Text.fail "unsupported: over-all conditions that are not linear between happenings";
      Printf.printf "(%s %s %s (%s) %s %s)\n" (flag (is_allowed r)) (flag (is_valid r)) (flags r.edges_kept)
        (String.concat " " (List.map2 pair r.mutex_pairs r.pairs_apart)) (flags r.duties_met) (flags r.effects_agree)
  | tree -> Text.bad "the values of parameters and the times of time points" tree

let print file = List.iter (line file) file.Pddl.rest
