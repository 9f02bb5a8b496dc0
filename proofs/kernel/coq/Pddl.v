(** What syntax trees of PDDL and of a plan mean: the ground plan of Spec.v that they stand for. Nothing is proved of
    [ground]; it is the meaning of texts, to be read as such. The theorems at the end say what quantifiers come to.

    Words are numbered by whoever reads the texts; 0 is the type `object`. *)

Require Import Reals QArith List Bool.
Require Import Spec.
Import ListNotations.
Open Scope nat_scope.

(** ** Syntax trees *)

(** A predicate or function, and what it is said of: objects and variables. *)
Definition words := list nat.

(** Variables, each with its types; it has one of these. *)
Definition variables := list (nat * list nat).

Inductive expression :=
| Number (q : Q)
| Duration                  (* ?duration *)
| Unknown (x : nat)         (* a parameter of the plan *)
| Value (f : words)
| Operate (o : operation) (x y : expression).

Inductive timing := AtStart | AtEnd | Throughout.

(** [During] is only used outside of everything else but [Every] and [ForAll]. *)
Inductive formula :=
| Is (a : words)
| Same (x y : nat)                                  (* one object *)
| AtLeast (strict : bool) (x y : expression)        (* x >= y, or x > y *)
| Equals (x y : expression)
| Never (c : formula)                               (* not *)
| Every (l : list formula)                          (* and *)
| Some_ (l : list formula)                          (* or *)
| ForAll (xs : variables) (c : formula)
| Exists (xs : variables) (c : formula)
| During (w : timing) (c : formula).                (* at start, at end, over all *)

Inductive outcome :=
| Becomes (a : words)
| Ceases (a : words)
| Raise (f : words) (x : expression)
| Set_ (f : words) (x : expression)
| Flows (f : words) (x : expression)                (* (increase f ( * #t x)) *)
| Together (l : list outcome)
| ForEach (xs : variables) (e : outcome)
| When (c : formula) (e : outcome)
| From (w : timing) (e : outcome).                  (* at start, at end *)

Record action := {
  called : nat;
  lasting : bool;
  takes : variables;
  durations : formula;
  conditions : formula;
  outcomes : outcome
}.

Record domain := {
  types : list (nat * nat);                (* a type, and one above it *)
  objects : list (nat * list nat);         (* each with its types *)
  actions : list action;
  facts_at_first : list words;
  values_at_first : list (words * expr);
  goal : formula;
  later : list (Q * outcome)               (* timed initial literals, by their times *)
}.

Record instance := {
  does : nat;                              (* the name of the action *)
  lasts : bool;
  of_objects : list nat;
  unknowns : list (nat * nat);             (* parameters of the plan, by their names in the action *)
  varied : option nat                      (* the name of the one that is the duration, whatever the action says *)
}.

Inductive spot := Zero | StartOf (i : nat) | EndOf (i : nat).   (* of the instance with that number *)

(** low <= t_until - t_from <= high *)
Record constraint := { from : spot; until : spot; low : option expr; high : option expr }.

(** ** Objects and types *)

Section Ground.
Variable number : words -> nat.   (* gives each atom, and each fluent, a number of its own *)
Variable D : domain.

Fixpoint below (depth a b : nat) : bool :=
  Nat.eqb a b || Nat.eqb b 0 ||
  match depth with
  | O => false
  | S depth => existsb (fun x => Nat.eqb (fst x) a && below depth (snd x) b) (types D)
  end.

Definition has_type (o : nat) (l : list nat) : bool :=
  existsb (fun x => Nat.eqb (fst x) o && existsb (fun a => existsb (below (length (types D)) a) l) (snd x)) (objects D).

(** What variables stand for, and all ways to choose objects for some more. *)
Definition names := list (nat * nat).

Definition meaning (e : names) (x : nat) : nat :=
  match find (fun y => Nat.eqb (fst y) x) e with Some y => snd y | None => x end.

Fixpoint choices (e : names) (xs : variables) : list names :=
  match xs with
  | [] => [e]
  | (x, l) :: rest =>
      flat_map (fun o => choices ((x, o) :: e) rest) (filter (fun o => has_type o l) (map fst (objects D)))
  end.

(** ** Expressions, conditions and effects of an action between two time points *)

Section Between.
Variable start end_ : nat.
Variable given : names.           (* numbers of parameters of the plan *)

Definition ground_words (e : names) (l : words) : nat := number (map (meaning e) l).

Fixpoint ground_expression (e : names) (x : expression) : term :=
  match x with
  | Number q => Linear (Num q)
  | Duration => Linear (Minus (Time end_) (Time start))
  | Unknown x => Linear (Param (meaning given x))
  | Value f => Fluent (ground_words e f)
  | Operate o x y => Calculate o (ground_expression e x) (ground_expression e y)
  end.

Definition at_least (e : names) (strict : bool) (x y : expression) : cond :=
  Compare strict (Calculate Difference (ground_expression e x) (ground_expression e y)).

Fixpoint ground_formula (e : names) (c : formula) : cond :=
  match c with
  | Is a => Atom (ground_words e a)
  | Same x y => if Nat.eqb (meaning e x) (meaning e y) then Always else Not Always
  | AtLeast strict x y => at_least e strict x y
  | Equals x y => And (at_least e false x y) (at_least e false y x)
  | Never c => Not (ground_formula e c)
  | Every l => fold_right And Always (map (ground_formula e) l)
  | Some_ l => fold_right Or (Not Always) (map (ground_formula e) l)
  | ForAll xs c => fold_right And Always (map (fun e => ground_formula e c) (choices e xs))
  | Exists xs c => fold_right Or (Not Always) (map (fun e => ground_formula e c) (choices e xs))
  | During _ c => ground_formula e c
  end.

(** The parts of a conjunction, each with its time. *)
Fixpoint parts (w : timing) (e : names) (c : formula) : list (timing * cond) :=
  match c with
  | During w c => parts w e c
  | Every l => flat_map (parts w e) l
  | ForAll xs c => flat_map (fun e => parts w e c) (choices e xs)
  | _ => match ground_formula e c with Always => [] | d => [(w, d)] end
  end.

Definition duty_of (x : timing * cond) : duty :=
  match fst x with
  | AtStart => AtPoint start (snd x)
  | AtEnd => AtPoint end_ (snd x)
  | Throughout => OverAll start end_ (snd x)
  end.

(** Whether a condition can be true, and whether it can be false, by what it says of objects alone. *)
Fixpoint possible (c : cond) : bool * bool :=
  match c with
  | Always => (true, false)
  | Atom _ | Compare _ _ => (true, true)
  | Not c => let (y, n) := possible c in (n, y)
  | And c d => let (y, n) := possible c in let (y', n') := possible d in (y && y', n || n')
  | Or c d => let (y, n) := possible c in let (y', n') := possible d in (y || y', n && n')
  end.

(** An effect whose condition is false by what it says of objects alone is none. *)
Fixpoint ground_outcome (p : nat) (c : cond) (e : names) (x : outcome) : list (effect + flow) :=
  let effect_ m := [inl {| point := p; guard := c; makes := m |}] in
  match x with
  | Becomes a => effect_ (Add (ground_words e a))
  | Ceases a => effect_ (Del (ground_words e a))
  | Raise f x => effect_ (Increase (ground_words e f) (ground_expression e x))
  | Set_ f x => effect_ (Assign (ground_words e f) (ground_expression e x))
  | Flows f x => [inr {| starts := start; ends := end_; flows_to := ground_words e f; rate := ground_expression e x |}]
  | Together l => flat_map (ground_outcome p c e) l
  | ForEach xs x => flat_map (fun e => ground_outcome p c e x) (choices e xs)
  | When d x =>
      let d := ground_formula e d in if fst (possible d) then ground_outcome p (And c d) e x else []
  | From w x => ground_outcome (match w with AtEnd => end_ | _ => start end) c e x
  end.

End Between.

(** ** Steps of the plan *)

Definition fits (s : instance) (a : action) : bool :=
  Nat.eqb (called a) (does s) && eqb (lasting a) (lasts s) && Nat.eqb (length (takes a)) (length (of_objects s)) &&
  forallb (fun x => has_type (fst x) (snd (snd x))) (combine (of_objects s) (takes a)).

(** With its time points. *)
Fixpoint with_points (next : nat) (l : list instance) : list (instance * nat * nat) :=
  match l with
  | [] => []
  | s :: rest => let last := if lasts s then S next else next in (s, next, last) :: with_points (S last) rest
  end.

(** A duration that the plan makes a parameter is equal to it, instead of what the action says. *)
Fixpoint instead (s : instance) (c : formula) : formula :=
  match c, varied s with
  | Equals Duration _, Some x => Equals Duration (Unknown x)
  | Every l, _ => Every (map (instead s) l)
  | ForAll xs c, _ => ForAll xs (instead s c)
  | During w c, _ => During w (instead s c)
  | c, _ => c
  end.

(** A step that is of no action, or of other types than its action takes, breaks an obligation. *)
Definition duties_of (x : instance * nat * nat) : list duty :=
  let '(s, p, q) := x in
  match find (fits s) (actions D) with
  | None => [AtPoint p (Not Always)]
  | Some a =>
      let e := combine (map fst (takes a)) (of_objects s) in
      let all c := map (duty_of p q) (parts p q (unknowns s) AtStart e c) in
      (if lasts s then [AtPoint p (at_least p q (unknowns s) e false Duration (Number 0))] else []) ++
      all (instead s (durations a)) ++ all (conditions a)
  end.

Definition outcomes_of (x : instance * nat * nat) : list (effect + flow) :=
  let '(s, p, q) := x in
  match find (fits s) (actions D) with
  | None => []
  | Some a => ground_outcome p q (unknowns s) p Always (combine (map fst (takes a)) (of_objects s)) (outcomes a)
  end.

Definition effects_in : list (effect + flow) -> list effect := flat_map (fun x => match x with inl w => [w] | _ => [] end).
Definition flows_in : list (effect + flow) -> list flow := flat_map (fun x => match x with inr k => [k] | _ => [] end).

(** By their time points. *)
Definition effects_of (x : instance * nat * nat) : list effect :=
  let '(s, p, q) := x in
  let l := effects_in (outcomes_of x) in
  filter (fun w => Nat.eqb (point w) p) l ++ if lasts s then filter (fun w => Nat.eqb (point w) q) l else [].

(** ** The network *)

Definition spot_point (l : list (instance * nat * nat)) (x : spot) : nat :=
  match x with
  | Zero => 0
  | StartOf i => match nth_error l i with Some (_, p, _) => p | None => 0 end
  | EndOf i => match nth_error l i with Some (_, _, q) => q | None => 0 end
  end.

Definition negated (e : expr) : expr := match e with Num q => Num (- q) | _ => Scale (- (1)) e end.

Definition edges_of (l : list (instance * nat * nat)) (c : constraint) : list (nat * nat * expr) :=
  let a := spot_point l (from c) in
  let b := spot_point l (until c) in
  match low c with Some w => [(a, b, w)] | None => [] end ++
  match high c with Some w => [(b, a, negated w)] | None => [] end.

(** ** The plan.  Time points of steps come first, then those of timed initial literals, and none is before 0. *)

Definition ground (unknowns_of_goal : names) (steps : list instance) (constraints : list constraint) : plan :=
  let l := with_points 1 steps in
  let first := fold_right (fun x n => Nat.max (S (snd x)) n) 1 l in
  let timed := combine (seq first (length (later D))) (later D) in
  let values := map (fun x => (number (fst x), snd x)) (values_at_first D) in
  {| true_at_first := map number (facts_at_first D);
     value_at_first := fun f => match find (fun x => Nat.eqb (fst x) f) values with Some x => snd x | None => Num 0 end;
     effects := flat_map effects_of l ++
       flat_map (fun x => effects_in (ground_outcome 0 0 [] (fst x) Always [] (snd (snd x)))) timed;
     flows := flat_map (fun x => flows_in (outcomes_of x)) l;
     edges := flat_map (edges_of l) constraints ++
       flat_map (fun x => [(0, fst x, Num (fst (snd x))); (fst x, 0, Num (- fst (snd x)))]) timed ++
       map (fun p => (0, p, Num 0)) (seq 1 (first - 1 + length timed));
     duties := flat_map duties_of l ++ map (fun x => Goal (snd x)) (parts 0 0 unknowns_of_goal AtStart [] (goal D));
     timed := map fst timed |}.

(** ** Quantifiers mean what they say, in each state of each schedule *)

Section Quantifiers.
Variables g t : nat -> R.
Variable s : state.
Variables start end_ : nat.
Variables given e : names.

Local Notation holds_for e c := (sat g t s (ground_formula start end_ given e c) = true).

Theorem for_all xs c : holds_for e (ForAll xs c) <-> forall e', In e' (choices e xs) -> holds_for e' c.
Proof.
  cbn [ground_formula]. induction (choices e xs) as [|e' l IH]; simpl; [easy|].
  rewrite andb_true_iff, IH. split; [intros [A B] e'' [<-|I]; auto | auto].
Qed.

Theorem exists_one xs c : holds_for e (Exists xs c) <-> exists e', In e' (choices e xs) /\ holds_for e' c.
Proof.
  cbn [ground_formula]. induction (choices e xs) as [|e' l IH]; simpl; [split; [easy | intros [x [[] _]]]|].
  rewrite orb_true_iff, IH. split; [intros [A|[x [I A]]]; eauto | intros [x [[<-|I] A]]; eauto].
Qed.

Theorem choices_are e' x l rest : In e' (choices e ((x, l) :: rest)) <->
  exists o, In o (map fst (objects D)) /\ has_type o l = true /\ In e' (choices ((x, o) :: e) rest).
Proof. cbn [choices]. rewrite in_flat_map. split; intros [o H]; exists o; rewrite filter_In in *; tauto. Qed.

End Quantifiers.

End Ground.
