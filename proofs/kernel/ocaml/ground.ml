(* `robust-kernel --ground FILE`: the ground plan that the trees in a file stand for, for whoever compares it with another one. *)
open Kernel

let list l = "(" ^ String.concat " " l ^ ")"
let number = string_of_int

(* What the numbers of words, atoms and fluents were given to. *)
let inverse table shown =
  let found = Hashtbl.create 1000 in
  Hashtbl.iter (fun key n -> Hashtbl.replace found n (shown key)) table;
  Hashtbl.find found

let print { Pddl.plan = p; _ } =
  let word = inverse Pddl.words (fun w -> w) in
  let name = inverse Pddl.numbered (fun l -> list (List.map word l)) in
  let rec expr = function
    | Num q -> Text.fraction q
    | Param i -> "#" ^ number i
    | Time p -> "@" ^ number p
    | Plus (a, b) -> list [ "+"; expr a; expr b ]
    | Minus (a, b) -> list [ "-"; expr a; expr b ]
    | Scale (q, a) -> list [ "*"; Text.fraction q; expr a ] in
  let sign = function Sum -> "+" | Difference -> "-" | Product -> "*" | Quotient -> "/" in
  let rec term = function
    | Linear e -> expr e
    | Fluent f -> name f
    | Calculate (o, a, b) -> list [ sign o; term a; term b ] in
  let rec cond = function
    | Always -> "always"
    | Atom a -> name a
    | Not c -> list [ "not"; cond c ]
    | And (c, d) -> list [ "and"; cond c; cond d ]
    | Or (c, d) -> list [ "or"; cond c; cond d ]
    | Compare (strict, x) -> list [ (if strict then ">" else ">="); term x ] in
  let change = function
    | Add a -> [ "add"; name a ]
    | Del a -> [ "delete"; name a ]
    | Increase (f, x) -> [ "increase"; name f; term x ]
    | Assign (f, x) -> [ "assign"; name f; term x ] in
  let effect w = list (number w.point :: cond w.guard :: change w.makes) in
  let flow k = list [ number k.starts; number k.ends; name k.flows_to; term k.rate ] in
  let edge ((a, b), w) = list [ number a; number b; expr w ] in
  let duty = function
    | AtPoint (p, c) -> list [ "at"; number p; cond c ]
    | OverAll (s, e, c) -> list [ "over"; number s; number e; cond c ]
    | Goal c -> list [ "goal"; cond c ] in
  let value (f, n) found = match p.value_at_first n with e -> list [ f; expr e ] :: found | exception Text.Malformed _ -> found in
  let fluents = List.sort_uniq compare (Hashtbl.fold (fun l n found -> (list (List.map word l), n) :: found) Pddl.numbered []) in
  let line head l = print_endline (list (head :: l)) in
  line "true" (List.sort_uniq compare (List.map name p.true_at_first));
  line "values" (List.fold_right value fluents []);
  line "effects" (List.map effect p.effects);
  line "flows" (List.map flow p.flows);
  line "constraints" (List.map edge p.edges);
  line "obligations" (List.map duty p.duties);
  line "timed" (List.map number p.timed)
