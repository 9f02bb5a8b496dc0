(* Plans with choices: what they are, trusted as far as reading goes, and what is claimed of them. *)
open Kernel
open Text

let label = list (both name name)
let unless_none f = function Word "-" -> None | tree -> Some (f tree)

let span = function
  | List [ a; b; low; high; guard ] ->
      { span_from = name a; span_until = name b; shortest = unless_none rational low; longest = unless_none rational high;
        span_if = label guard }
  | tree -> bad "two events, bounds and choices" tree

let demand = function
  | List [ atom; value; first; last; guard; owner ] ->
      { about = name atom; wanted = flag value; needed_from = name first; needed_until = name last; needed_if = label guard;
        needed_by = unless_none name owner }
  | tree -> bad "what is demanded" tree

let gain = function
  | List [ atom; value; event; guard; owner ] ->
      { of_atom = name atom; given = flag value; gained_at = name event; gained_if = label guard;
        gained_by = unless_none name owner }
  | tree -> bad "what becomes true or false" tree

type file = { texts : tree list; epsilon : q; plan : team_plan; claim : tree }

let file text =
  match read text with
  | [ List (Word "texts" :: texts); List [ Word "epsilon"; epsilon ]; List (Word "choices" :: sizes); List (Word "spans" :: spans);
      List (Word "demands" :: demands); List (Word "gains" :: gains); claim ] ->
      let plan = { sizes = List.map name sizes; spans = List.map span spans; demands = List.map demand demands;
                   gains = List.map gain gains } in
      Some { texts; epsilon = rational epsilon; plan; claim }
  | _ -> None

(* What has to be refuted. *)
let print file =
  match file.claim with
  | List [ Word "none"; assumed ] ->
      let forms = refuted_forms file.plan file.epsilon (label assumed) in
      List.iter Formulas.form forms;
      print_endline (Buffer.contents Formulas.out)
  | tree -> bad "a claim" tree

let run file =
  match file.claim with
  | List [ Word "execution"; values; times ] ->
      ( check_execution file.plan file.epsilon (list name values) (list rational times),
        "the values " ^ shown values ^ " of the choices, and the times " ^ shown times ^ " of the events, are a correct execution" )
  | List [ Word "none"; assumed; proof ] ->
      ( check_none file.plan file.epsilon (label assumed) (refutation proof),
        "no execution is correct with the values " ^ shown assumed ^ " of choices" )
  | tree -> bad "a claim" tree
