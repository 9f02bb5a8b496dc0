(* `robust-kernel --formulas FILE`: the formulas that orders do not decide, for whoever looks for refutations of them.
   Not trusted: what is printed here decides nothing. *)
open Kernel

let out = Buffer.create 65536
let add = Buffer.add_string out
let moment = function Now -> "" | Before p -> Printf.sprintf "@%d" p | Halfway (p, q) -> Printf.sprintf "@%d/%d" p q
let variable = function
  | VPar i -> Printf.sprintf "#%d" i
  | VTime p -> Printf.sprintf "@%d" p
  | VNow -> "now"
  | VJump (w, before, m) -> Printf.sprintf "j%d%s%s" w (if before then "b" else "a") (moment m)
  | VFlow (k, m) -> Printf.sprintf "k%d%s" k (moment m)
  | VFired w -> Printf.sprintf "f%d" w
  | VAmount w -> Printf.sprintf "a%d" w
  | VTerm _ | VDrift _ -> "?"  (* what is not linear: of that, nothing can be refuted *)

let rec form = function
  | FTrue -> add "1 "
  | FCmp (strict, (constant, terms)) ->
      add (if strict then "( > " else "( >= ");
      add (Text.fraction constant);
      List.iter (fun (x, q) -> add " "; add (variable x); add " "; add (Text.fraction q)) terms;
      add " ) "
  | FNot f -> add "( ~ "; form f; add ") "
  | FAnd (f, h) -> add "( & "; form f; form h; add ") "

(* One line: a number, then the formulas, the one that is to be refuted first. *)
let forms number i o first others =
  match simplified o i first others with
  | FNot FTrue, _ -> ()
  | claim, rest ->
      add (string_of_int number);
      add " ";
      form claim;
      List.iter form rest;
      add "\n"

(* As if all lemmas followed: the checker finds out. *)
let orders tree =
  let bound = function Text.List (a :: b :: k :: _) -> (Text.name a, Text.name b, Text.rational k) | tree -> Text.bad "an order lemma" tree in
  List.fold_left (fun o (a, b, k) -> learnt o a b k) M.empty (Text.list bound tree)

let happening plan = marked (happenings plan)

(* An obligation: the number of a duty, or two time points that have to be apart. *)
let number plan tree =
  let apart = pairs plan in
  match tree with
  | Text.List [ k ] -> List.length apart + Text.name k
  | Text.List [ p; q ] ->
      let wanted = (Text.name p, Text.name q) in
      let rec find n = function [] -> Text.bad "an obligation" tree | x :: l -> if x = wanted then n else find (n + 1) l in
      find 0 apart
  | tree -> Text.bad "an obligation" tree

let asked (file : Pddl.file) = function
  | Text.List [ Text.Word "obligations"; region; lemmas; removed ] ->
      let plan = file.plan in
      let o = orders lemmas in
      let also = outside (Text.list (Text.list Text.side) removed) in
      let at_end = happening plan in
      List.iteri (fun n b ->
        forms (n + 1) (place_of at_end b) o (root plan file.epsilon b) (fun () -> meant plan b @ also))
        (obligations plan)
  | Text.List [ Text.Word "breaks"; which ] ->
      let b = List.nth (obligations file.plan) (number file.plan which) in
      forms 0 (end_only (happening file.plan) b) M.empty (FNot (root file.plan file.epsilon b)) (fun () -> meant file.plan b)
  | Text.List [ Text.Word "each"; which; region; lemmas ] ->
      let plan = file.plan in
      let o = orders lemmas in
      let named = Text.both (fun tree -> Text.positive (1 + number plan tree)) (Text.both Text.name Text.name) in
      forms 0 (AfterAll (happening plan)) o FTrue (fun () -> none_broken plan file.epsilon (Text.list named which))
  | Text.List [ Text.Word "outside"; polyhedra ] ->
      forms 0 Anywhere M.empty FTrue (fun () -> outside (Text.list (Text.list Text.side) polyhedra))
  | tree -> Text.bad "a question" tree

(* The pairs of time points that have to be apart: obligations are numbered from 1, these first. *)
let print (file : Pddl.file) =
  if not (supported file.plan file.epsilon) then Text.fail "unsupported: a separation below 0, two timed initial literals that may change a fluent at one time, a rate that changes, or a division by something that is not constant, or by zero";
  List.iter (fun (p, q) -> add (Printf.sprintf "%d %d " p q)) (pairs file.plan);
  add "\n";
  List.iter (fun question -> asked file question; add ".\n") file.rest;
  print_string (Buffer.contents out)
