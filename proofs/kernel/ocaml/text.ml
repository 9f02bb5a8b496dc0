(* Reads words, numbers, regions and certificates. Trusted, as far as words, numbers and regions go. *)
open Kernel

exception Malformed of string

type tree = Word of string | List of tree list

let fail text = raise (Malformed text)

let read text =
  let n = String.length text in
  let blank i = match text.[i] with ' ' | '\n' | '\r' | '\t' -> true | _ -> false in
  let rec skip i = if i < n && blank i then skip (i + 1) else i in
  let rec items i found =
    let i = skip i in
    if i >= n then (List.rev found, i)
    else match text.[i] with
      | ')' -> (List.rev found, i)
      | '(' ->
          let inside, j = items (i + 1) [] in
          if j >= n then fail "a ')' is missing";
          items (j + 1) (List inside :: found)
      | _ ->
          let j = ref i in
          while !j < n && not (blank !j || text.[!j] = '(' || text.[!j] = ')') do incr j done;
          items !j (Word (String.sub text i (!j - i)) :: found) in
  match items 0 [] with
  | found, j when j = n -> found
  | _ -> fail "a ')' too many"

let rec shown = function
  | Word w -> w
  | List l -> "(" ^ String.concat " " (List.map shown l) ^ ")"

let bad what tree =
  let text = shown tree in
  fail (Printf.sprintf "found %s, expected %s" (if String.length text > 60 then String.sub text 0 60 ^ "..." else text) what)

(* -- numbers: digits are added up by Coq's own arithmetic ------------------------------------------------------------ *)

let rec positive n = if n = 1 then XH else if n land 1 = 0 then XO (positive (n / 2)) else XI (positive (n / 2))
let small = Array.init 2048 (fun i -> positive (i + 1))
let positive n = if n <= 2048 then small.(n - 1) else positive n
let z_of n = if n = 0 then Z0 else if n > 0 then Zpos (positive n) else Zneg (positive (-n))

let integer text =
  let negative = text <> "" && text.[0] = '-' in
  let from = if negative then 1 else 0 in
  let length = String.length text - from in
  String.iteri (fun i c -> if i >= from && (c < '0' || c > '9') then bad "a number" (Word text)) text;
  if length = 0 then bad "a number" (Word text);
  let rec value last =  (* of the first digits, up to that place *)
    if last <= 15 then z_of (int_of_string ("0u" ^ String.sub text from last))
    else Z.add (Z.mul (value (last - 15)) (z_of 1_000_000_000_000_000))
           (z_of (int_of_string ("0u" ^ String.sub text (from + last - 15) 15))) in
  match value length with Zpos p when negative -> Zneg p | whole -> whole

let word = function Word w -> w | tree -> bad "a word" tree
let list f = function List l -> List.map f l | tree -> bad "a list" tree
let pos tree = match integer (word tree) with Zpos p -> p | _ -> bad "a number above 0" tree
let flag = function Word "t" -> true | Word "f" -> false | tree -> bad "t or f" tree
let name tree = match int_of_string_opt (word tree) with Some n when n >= 0 -> n | _ -> bad "the number of something" tree

let rational tree =
  match String.split_on_char '/' (word tree) with
  | [ a ] -> { qnum = integer a; qden = XH }
  | [ a; b ] -> { qnum = integer a; qden = pos (Word b) }
  | _ -> bad "a rational number" tree

let both f g = function List [ a; b ] -> (f a, g b) | tree -> bad "two things" tree

(* Decimal digits, by Coq's own arithmetic. *)
let rec digits z = match z with
  | Zneg p -> "-" ^ digits (Zpos p)
  | z ->
      let rec small = function XH -> 1 | XO p -> 2 * small p | XI p -> 2 * small p + 1 in
      let int = function Zpos p -> small p | _ -> 0 in
      let above, below = Z.div_eucl z (z_of 1_000_000_000) in
      if above = Z0 then string_of_int (int z) else Printf.sprintf "%s%09d" (digits above) (int below)

let fraction q = let q = qred q in if q.qden = XH then digits q.qnum else digits q.qnum ^ "/" ^ digits (Zpos q.qden)

(* -- expressions ------------------------------------------------------------------------------------------------------------- *)

let rec expr = function
  | Word w when w.[0] = '#' -> Param (name (Word (String.sub w 1 (String.length w - 1))))
  | Word w when w.[0] = '@' -> Time (name (Word (String.sub w 1 (String.length w - 1))))
  | Word _ as tree -> Num (rational tree)
  | List [ Word "+"; a; b ] -> Plus (expr a, expr b)
  | List [ Word "-"; a; b ] -> Minus (expr a, expr b)
  | List [ Word "*"; q; a ] -> Scale (rational q, expr a)
  | tree -> bad "an expression" tree

let operation = function
  | "+" -> Sum | "-" -> Difference | "*" -> Product | "/" -> Quotient
  | word -> bad "an operation" (Word word)

(* -- certificates ------------------------------------------------------------------------------------------------------ *)

let lit tree = match integer (word tree) with Zpos p -> (true, p) | Zneg p -> (false, p) | Z0 -> bad "a literal" tree

(* `#i`, `@p`, `now`, `f3` and `a3` (whether effect 3 fires, and its amount); and by now or, with `@7`, just before time point 7,
   or with `@7/9` halfway between 7 and 9, `k3` (what the continuous effect 3 has done), `j3b` and `j3a` (what effect 3 has
   contributed, before and after effects at that time). *)
let variable tree =
  let w = word tree in
  let from, length = if w = "" then bad "a variable" tree else 1, String.length w in
  let number last = name (Word (String.sub w from (last - from))) in
  let until, moment = match String.rindex_opt w '@' with
    | Some i when i > 0 ->
        let points = String.split_on_char '/' (String.sub w (i + 1) (length - i - 1)) in
        (i, match List.map (fun p -> name (Word p)) points with
          | [ p ] -> Before p
          | [ p; q ] -> Halfway (p, q)
          | _ -> bad "a variable" tree)
    | _ -> (length, Now) in
  match w.[0] with
  | 'n' when w = "now" -> VNow
  | 'j' -> VJump (number (until - 1), w.[until - 1] = 'b', moment)
  | 'k' -> VFlow (number until, moment)
  | '#' when moment = Now -> VPar (number length)
  | '@' when moment = Now -> VTime (number length)
  | 'f' when moment = Now -> VFired (number length)
  | 'a' when moment = Now -> VAmount (number length)
  | _ -> bad "a variable" tree

let node = function
  | List [] -> NTrue
  | List [ a; b ] -> NAnd (lit a, lit b)
  | List (strict :: constant :: terms) ->
      NCmp (flag strict, (rational constant, List.map (both variable rational) terms))
  | tree -> bad "a node" tree

let multiples = list (both pos rational)
let hint = function Word _ as n -> Earlier (pos n) | List [ g; which ] -> Gate (pos g, name which) | tree -> bad "a hint" tree

let step = function
  | List [ clause; factors; facts ] -> Farkas (list lit clause, list rational factors, multiples facts)
  | List [ clause; hints ] -> Propagate (list lit clause, list hint hints)
  | tree -> bad "a step" tree

let refutation = function
  | List [ nodes; roots; steps ] ->
      { nodes = list node nodes; roots = list (both pos lit) roots; steps = list step steps }
  | tree -> bad "a refutation" tree

let lemma = function
  | List [ a; b; k; ms ] -> (((name a, name b), rational k), multiples ms)
  | tree -> bad "an order lemma" tree

let side = both expr flag
let placement = function
  | List [ times; keeps ] -> { times = list expr times; keeps = list multiples keeps }
  | tree -> bad "a schedule" tree
let proofs = function
  | List [ lemmas; refutations ] -> { lemmas = list lemma lemmas; refutations = list (both pos refutation) refutations }
  | tree -> bad "order lemmas and refutations" tree

(* -- claims -------------------------------------------------------------------------------------------------------------- *)

let ends tree = match tree with
  | List [ low; low_closed; high; high_closed ] ->
      let read value closed = match value with Word "-" -> None | _ -> Some (rational value, flag closed) in
      { lower = read low low_closed; upper = read high high_closed }
  | tree -> bad "a range" tree

let rec reason = function
  | List [ Word "none"; ms ] -> NoSchedule (multiples ms)
  | List [ Word "breaks"; s; instant; which; proof ] -> Breaks (placement s, expr instant, pos which, refutation proof)
  | List [ Word "each"; which; lemmas; proof ] -> EachBreaks (list (both pos (both name name)) which, list lemma lemmas, refutation proof)
  | List [ Word "split"; one; r; other ] -> Split (side one, reason r, reason other)
  | tree -> bad "a reason" tree

let face = function
  | List [] -> None
  | List [ limit; beyond; why ] ->
      Some { limit = list rational limit; beyond = list rational beyond; why = reason why }
  | tree -> bad "a face" tree

let option f = function List [] -> None | tree -> Some (f tree)

type claim =
  | Good of range list * range list * (expr * bool) list * certificate  (* declared, the box, more sides *)
  | Maximal of range list * range list * certificate * (face option * face option) list
  | Envelope of range list * envelope_certificate

let certificate = function
  | [ example; within; s; checked ] ->
      { example = list rational example; within = list multiples within; schedule = placement s; checked = proofs checked }
  | _ -> fail "found something else than a point, multiples, a schedule and proofs"

let claim = function
  | List (Word "good" :: declared :: box :: more :: rest) ->
      Good (list ends declared, list ends box, list side more, certificate rest)
  | List (Word "maximal" :: declared :: box :: faces :: rest) ->
      Maximal (list ends declared, list ends box, certificate rest, list (both face face) faces)
  | List [ Word "envelope"; declared; removed; others; pieces; cover ] ->
      Envelope (list ends declared,
        { removed = list (both (list side) reason) removed; others = proofs others;
          pieces = list (both (list side) placement) pieces; cover = option refutation cover })
  | tree -> bad "a claim" tree
