(* Syntax trees of PDDL and of plans, from texts that have been taken apart into words and lists. Trusted: it knows the keywords,
   and what names refer to; what a tree means is said in Pddl.v. Numbers are written as fractions. *)
open Kernel
open Text

(* Numbers for words, and for atoms and fluents. *)
let numbering () =
  let known = Hashtbl.create 1000 in
  let number word =
    match Hashtbl.find_opt known word with
    | Some n -> n
    | None -> let n = Hashtbl.length known in Hashtbl.add known word n; n in
  (number, known)

let named, words = numbering ()
let number, numbered = numbering ()
let object_ = named "object"  (* which Pddl.v wants to be 0 *)
let its_duration = named "?duration"
let name_in tree = named (word tree)
let names_in = List.map name_in
let tail w = String.sub w 1 (String.length w - 1)

(* `a b - t c`: names with their types. *)
let typed l =
  let types = function List (Word "either" :: l) -> names_in l | tree -> [ name_in tree ] in
  let rec read names = function
    | Word "-" :: tree :: rest -> List.rev_map (fun x -> (x, types tree)) names @ read [] rest
    | tree :: rest -> read (name_in tree :: names) rest
    | [] -> List.rev_map (fun x -> (x, [ object_ ])) names in
  read [] l

(* -- expressions, conditions and effects; `refers` says whether a word is an object, or a variable that stands for one ------- *)

let number_of w = match rational (Word w) with q -> Some q | exception Malformed _ -> None
let nothing = Number { qnum = Z0; qden = XH }

let rec expression = function
  | Word "?duration" -> Duration
  | Word w when w.[0] = '?' -> Unknown (named w)
  | Word w -> (match number_of w with Some q -> Number q | None -> Value [ named w ])
  | List [ Word "-"; x ] -> Operate (Difference, nothing, expression x)
  | List (Word ("+" | "-" | "*" | "/" as o) :: first :: l) ->
      List.fold_left (fun a b -> Operate (operation o, a, expression b)) (expression first) l
  | List l -> Value (names_in l)

let timing = function "start" -> AtStart | "end" -> AtEnd | w -> bad "start or end" (Word w)

let rec formula refers = function
  | List [] -> Every []
  | List (Word "and" :: l) -> Every (List.map (formula refers) l)
  | List (Word "or" :: l) -> Some_ (List.map (formula refers) l)
  | List [ Word "not"; c ] -> Never (formula refers c)
  | List [ Word "imply"; c; d ] -> Some_ [ Never (formula refers c); formula refers d ]
  | List [ Word "forall"; List xs; c ] -> ForAll (typed xs, formula refers c)
  | List [ Word "exists"; List xs; c ] -> Exists (typed xs, formula refers c)
  | List [ Word "="; Word x; Word y ] when refers x && refers y -> Same (named x, named y)
  | List [ Word "="; x; y ] -> Equals (expression x, expression y)
  | List [ Word (">" | ">=" as w); x; y ] -> AtLeast (w = ">", expression x, expression y)
  | List [ Word ("<" | "<=" as w); x; y ] -> AtLeast (w = "<", expression y, expression x)
  | List [ Word "at"; Word ("start" | "end" as w); (List _ as c) ] -> During (timing w, formula refers c)
  | List [ Word "over"; Word "all"; (List _ as c) ] -> During (Throughout, formula refers c)
  | List l -> Is (names_in l)
  | tree -> bad "a condition" tree

let target = function Word w -> [ named w ] | List l -> names_in l

let rec outcome refers = function
  | List [] -> Together []
  | List (Word "and" :: l) -> Together (List.map (outcome refers) l)
  | List [ Word "forall"; List xs; e ] -> ForEach (typed xs, outcome refers e)
  | List [ Word "at"; Word ("start" | "end" as w); (List _ as e) ] -> From (timing w, outcome refers e)
  | List [ Word "when"; List [ Word "at"; Word w; (List _ as c) ]; List [ Word "at"; Word u; (List _ as e) ] ] when w = u ->
      From (timing w, When (formula refers c, outcome refers e))
  | List [ Word "when"; c; e ] -> When (formula refers c, outcome refers e)
  | List [ Word "not"; List a ] -> Ceases (names_in a)
  | List [ Word "increase"; f; List ([ Word "*"; Word "#t"; x ] | [ Word "*"; x; Word "#t" ]) ] -> Flows (target f, expression x)
  | List [ Word "decrease"; f; List ([ Word "*"; Word "#t"; x ] | [ Word "*"; x; Word "#t" ]) ] ->
      Flows (target f, Operate (Difference, nothing, expression x))
  | List [ Word "increase"; f; x ] -> Raise (target f, expression x)
  | List [ Word "decrease"; f; x ] -> Raise (target f, Operate (Difference, nothing, expression x))
  | List [ Word "assign"; f; x ] -> Set_ (target f, expression x)
  | List [ Word "scale-up"; f; x ] -> Set_ (target f, Operate (Product, Value (target f), expression x))
  | List [ Word "scale-down"; f; x ] -> Set_ (target f, Operate (Quotient, Value (target f), expression x))
  | List a -> Becomes (names_in a)
  | tree -> bad "an effect" tree

(* -- domain and problem ------------------------------------------------------------------------------------------------------ *)

let part head sections = match List.assoc_opt head sections with Some l -> l | None -> []
let section = function List (Word head :: rest) -> (head, rest) | tree -> bad "a section" tree

(* `?a ?b - number`, perhaps as one list. *)
let unknown_names l = List.filter (fun w -> w.[0] = '?') (List.map word (match l with [ List l ] -> l | l -> l))

(* What stands behind each keyword, the last word first. *)
let keywords =
  List.fold_left (fun parts tree ->
    match tree, parts with
    | Word w, _ when w.[0] = ':' -> (w, []) :: parts
    | List (Word (":synth-parameters" as w) :: l), _ -> (w, List.rev l) :: parts
    | _, (w, l) :: rest -> (w, tree :: l) :: rest
    | _, [] -> bad "a keyword" tree) []

let items tree = match tree with List l -> l | Word _ -> bad "a list" tree

(* An action, and the names of its own parameters of the plan. *)
let action refers lasting called rest =
  let parts = keywords rest in
  let part w = match List.assoc_opt w parts with Some [ tree ] -> tree | _ -> List [] in
  let own = match List.assoc_opt ":synth-parameters" parts with Some l -> unknown_names (List.rev l) | None -> [] in
  let refers w = refers w && not (List.mem w own) in
  ( { called = name_in called; lasting; takes = typed (items (part ":parameters"));
      durations = formula refers (part ":duration");
      conditions = formula refers (part (if lasting then ":condition" else ":precondition"));
      outcomes = outcome refers (part ":effect") },
    own )

(* Some facts are atoms, some are values, and some come later. *)
let fact = function
  | List [ Word "at"; time; (List l as fact) ] ->
      let literal = match l with [ Word "="; f; x ] -> Set_ (target f, expression x) | _ -> outcome (fun _ -> true) fact in
      `Later (rational time, literal)
  | List [ Word "="; f; List [ Word "-"; x ] ] -> `Value (target f, Num (qopp (rational x)))
  | List [ Word "="; f; x ] -> `Value (target f, Num (rational x))
  | List [ Word "not"; _ ] -> `Nothing
  | tree -> `Atom (names_in (items tree))

(* Literals of one time together, in the order of times. *)
let by_times l =
  let times = List.sort_uniq (fun x y -> if qeq_bool x y then 0 else if qle_bool x y then -1 else 1) (List.map fst l) in
  let at time = List.filter_map (fun (x, e) -> if qeq_bool x time then Some e else None) l in
  let once l = List.rev (List.fold_left (fun found e -> if List.mem e found then found else e :: found) [] l) in
  List.map (fun time -> (time, Together (once (at time)))) times

(* -- the plan ---------------------------------------------------------------------------------------------------------------- *)

let position names name = let rec find i = if i = Array.length names then None else if names.(i) = name then Some i else find (i + 1) in find 0

let ground_plan names pddl statements beside =
  let sections = List.map section pddl in
  let objects = typed (part ":constants" sections @ part ":objects" sections) in
  let known = List.map fst objects and common = unknown_names (part ":synth-parameters" sections) in
  let refers w = if w.[0] = '?' then w <> "?duration" && not (List.mem w common) else List.mem (named w) known in
  let of_action = function
    | (":action" | ":durative-action" as kind), called :: rest -> Some (action refers (kind = ":durative-action") called rest)
    | _ -> None in
  let actions = List.filter_map of_action sections in
  let facts = List.map fact (part ":init" sections) in
  let given kind = List.filter_map (function List [ Word k; x; p ] when k = kind -> Some (x, word p) | _ -> None) beside in
  let parameter name = match position names name with Some i -> i | None -> bad "a parameter" (Word name) in
  let initial (f, value) =
    match List.find_opt (fun (g, _) -> target g = f) (given "fluent") with
    | Some (_, p) -> (f, Param (parameter p))
    | None -> (f, value) in
  let d =
    { types = List.concat_map (fun (t, l) -> List.map (fun u -> (t, u)) l) (typed (part ":types" sections));
      objects; actions = List.map fst actions;
      facts_at_first = List.filter_map (function `Atom a -> Some a | _ -> None) facts;
      values_at_first = List.map initial (List.filter_map (function `Value v -> Some v | _ -> None) facts);
      goal = formula refers (List.hd (part ":goal" sections));
      later = by_times (List.filter_map (function `Later x -> Some x | _ -> None) facts) } in
  let unknowns prefix = List.filter_map (fun w ->
    match position names (prefix ^ tail w) with Some i -> Some (named w, i) | None -> None) in
  let instance i does lasts call =
    let own = match List.find_opt (fun (a, _) -> a.called = does) actions with Some (_, l) -> l | None -> [] in
    let varied = List.assoc_opt (Word i) (given "duration") in
    { does; lasts; of_objects = names_in call; varied = Option.map (fun _ -> its_duration) varied;
      unknowns = unknowns (i ^ ".") own @ unknowns "" common @
        match varied with Some p -> [ (its_duration, parameter p) ] | None -> [] } in
  let spots = Hashtbl.create 1000 in
  Hashtbl.add spots ".zero" Zero;
  let spot tree = match Hashtbl.find_opt spots (word tree) with Some s -> s | None -> bad "a time point" tree in
  let bound none tree =
    let w = word tree in
    if List.mem w none then None else
      match number_of w with Some q -> Some (Num q) | None -> Some (Param (parameter w)) in
  let rec read instances constraints = function
    | List [ Word ("action" | "durative-action" as kind); Word i; List (called :: call) ] :: rest ->
        let n = List.length instances in
        if kind = "action" then Hashtbl.add spots i (StartOf n)
        else (Hashtbl.add spots (i ^ ".start") (StartOf n); Hashtbl.add spots (i ^ ".end") (EndOf n));
        read (instance i (name_in called) (kind <> "action") call :: instances) constraints rest
    | List [ until; from; low; high ] :: rest ->
        let c = { from = spot from; until = spot until; low = bound [ "-inf" ] low; high = bound [ "inf"; "+inf" ] high } in
        read instances (c :: constraints) rest
    | [] -> (List.rev instances, List.rev constraints)
    | tree :: _ -> bad "a statement" tree in
  let instances, constraints = read [] [] statements in
  let plan = ground number d (unknowns "" common) instances constraints in
  let values = Hashtbl.create 1000 in
  List.iter (fun (f, _) -> let n = number f in if not (Hashtbl.mem values n) then Hashtbl.add values n (plan.value_at_first n)) d.values_at_first;
  let value f = match Hashtbl.find_opt values f with Some x -> x | None -> fail "a fluent has no initial value" in
  { plan with value_at_first = value }

(* -- files: named sections, each at its place ---------------------------------------------------------------------------------- *)

type file = { texts : tree list; names : string array; plan : plan; epsilon : q; rest : tree list }

let file text =
  match read text with
  | List (Word "texts" :: texts) :: List (Word "parameters" :: names) :: List (Word "pddl" :: pddl)
    :: List (Word "plan" :: statements) :: List (Word "beside" :: beside) :: List [ Word "epsilon"; epsilon ] :: rest ->
      let names = Array.of_list (List.map word names) in
      { texts; names; plan = ground_plan names pddl statements beside; epsilon = rational epsilon; rest }
  | _ -> fail "found other sections than texts, parameters, pddl, plan, beside, epsilon"
